"""Measured data that take hours to repeat: no value changes unnoticed.

Other tests compute samples of these files anew. A single altered number among thousands would
mostly slip through, so the files are held by checksums as well. After measuring anew:
`python tests/test_stored_data.py` writes `data/checksums.csv`.
"""

import csv
import hashlib
from pathlib import Path

DATA = Path(__file__).parents[1] / "data"
CHECKSUMS = DATA / "checksums.csv"
MEASURED = (
    "benchmarks.csv", "cradle_*.csv", "extremes_*.csv", "film_*.csv",
    "forces.csv", "gaps_*.csv", "implied_ratio.csv", "long_chains.csv", "parts.csv",
    "scene_*.csv",
)  # fmt: skip


def checksums(folder: Path) -> dict[str, str]:
    """Return the SHA-256 sum of every measured file, whatever the ends of its lines."""
    paths = sorted(path for pattern in MEASURED for path in folder.glob(pattern))
    return {
        path.name: hashlib.sha256(path.read_bytes().replace(b"\r\n", b"\n")).hexdigest()
        for path in paths
    }


def test_measured_data_are_as_they_were_stored():
    with CHECKSUMS.open(encoding="utf-8", newline="") as file:
        stored = {row["file"]: row["sha256"] for row in csv.DictReader(file)}
    assert len(stored) >= 10
    assert checksums(DATA) == stored


if __name__ == "__main__":
    with CHECKSUMS.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("file", "sha256"))
        writer.writerows(checksums(DATA).items())
