"""The recorded logs that tests read: pieces that are committed, and whole ones if they lie beside the
checkout."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PIECES = sorted((ROOT / "tests" / "data" / "logs").glob("*.tlog"))
SHIPPED = ROOT / "config" / "logs" / "escort-target.tlog"
WHOLE = sorted((ROOT.parent / "shared" / "tlogs").glob("*.tlog"))

LOGS = [
    *(pytest.param(path, id=path.stem) for path in (SHIPPED, *PIECES)),
    *(pytest.param(path, id=path.stem, marks=pytest.mark.slow) for path in WHOLE),
]
