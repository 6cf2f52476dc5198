"""Records of points, written atomically."""

import json
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from truespring.outputs import write_whole

# Age at which temporary files of killed processes are removed [s].
_STALE = 3600.0


class Store:
    """The records in OUT/points: NAME.json for each point that was solved or failed."""

    def __init__(self, out: Path) -> None:
        """Create the folder if it does not exist; raise OSError if that fails."""
        self.folder = out / "points"
        self.folder.mkdir(parents=True, exist_ok=True)
        for left in self.folder.glob(".*.tmp"):
            if time.time() - left.stat().st_mtime > _STALE:
                left.unlink(missing_ok=True)

    def write(self, record: Mapping[str, Any]) -> None:
        """Write a record under the name in its `point`."""
        text = json.dumps(record, indent=1, allow_nan=False)
        write_whole(self.folder / f"{record['point']}.json", f"{text}\n".encode())

    def read(self) -> Iterator[dict[str, Any]]:
        """Yield all records; damaged files are skipped, so that their points are solved again."""
        for file in sorted(self.folder.glob("*.json")):
            try:
                record = json.loads(file.read_text(encoding="utf-8"))
            except (OSError, ValueError):
                continue
            if isinstance(record, dict) and record.get("point") == file.stem and record.get("status") in STATUSES:
                yield record


CONVERGED, FAILED = "converged", "failed"
STATUSES = (CONVERGED, FAILED)
