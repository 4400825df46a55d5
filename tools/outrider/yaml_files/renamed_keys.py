"""Replacement of former names of keys by the present ones, with a remark for each."""

from __future__ import annotations

from outrider.yaml_files.schema_nodes import Schema
from outrider.yaml_files.tree import Entry, Flaw, Items, Mapping, Tree


def present_names(tree: Tree, schema: Schema) -> tuple[Tree, list[Flaw], list[Flaw]]:
    """Return ``tree`` with the present names of its keys, one remark for each former name, and the faults.

    ``renamed`` in a model's JSON Schema maps each former name to the present one. A key that is given twice,
    under whichever names, is a fault.
    """
    remarks: list[Flaw] = []
    faults: list[Flaw] = []
    return _renamed(tree, schema, remarks, faults), remarks, faults


def _renamed(tree: Tree, schema: Schema, remarks: list[Flaw], faults: list[Flaw]) -> Tree:
    if isinstance(tree, Items):
        items = [_renamed(item, schema.child(k), remarks, faults) for k, item in enumerate(tree.items)]
        return tree._replace(items=tuple(items))
    if not isinstance(tree, Mapping):
        return tree
    entries: dict[str, Entry] = {}
    for key, entry in tree.entries.items():
        name = _former(schema).get(key, key)
        if name != key and (name in tree.entries or name in entries):
            faults.append(Flaw(entry.at, f"{key!r} and {name!r} are the same key; needed: only {name!r}"))
            continue
        if name != key:
            remarks.append(
                Flaw(entry.at, f"{key!r} was renamed to {name!r}; the former name is still accepted")
            )
        entries[name] = entry._replace(tree=_renamed(entry.tree, schema.child(name), remarks, faults))
    return tree._replace(entries=entries)


def _former(schema: Schema) -> dict[str, str]:
    members = schema.choices or [schema.resolved]
    return {former: name for member in members for former, name in member.node.get("renamed", {}).items()}
