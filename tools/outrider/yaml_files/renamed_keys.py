"""Former names of keys: they still load, and are reported with the present name."""

from __future__ import annotations

from outrider.yaml_files.schema_nodes import Schema
from outrider.yaml_files.tree import Entry, Flaw, Items, Mapping, Tree


def present_names(tree: Tree, schema: Schema) -> tuple[Tree, list[Flaw], list[Flaw]]:
    """Return ``tree`` with the present names of its keys, a remark for each former name, and the faults.

    A model states its former names as ``renamed`` in its JSON Schema. A key that is given under both names is
    a fault.
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
        if name in tree.entries and name != key:
            faults.append(Flaw(entry.at, f"{key!r} is the former name of {name!r}; allowed: one of them"))
            continue
        if name != key:
            remarks.append(Flaw(entry.at, f"{key!r} is called {name!r} now; the former name still loads"))
        entries[name] = entry._replace(tree=_renamed(entry.tree, schema.child(name), remarks, faults))
    return tree._replace(entries=entries)


def _former(schema: Schema) -> dict[str, str]:
    members = schema.choices or [schema.resolved]
    return {former: name for member in members for former, name in member.node.get("renamed", {}).items()}
