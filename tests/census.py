"""A digest of what the package answers, by area: equal digests mean equal answers, to the bit.

For changes that are to change nothing: run it before and after; names of areas run these alone.
"""

import hashlib
import io
import os
import re
import shlex
import sys
import tempfile
import warnings
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import matplotlib
import numpy as np
from click.testing import CliRunner

import cradle
from cradle import fit
from cradle.command.solve import main
from cradle.pictures import animation, impacts

sys.path[:0] = [str(Path(__file__).parents[1] / folder) for folder in ("benchmarks", "tests")]
from chains import random_chains, uniform  # noqa: E402
from commands import examples  # noqa: E402
from test_entries import BAD, DATA, ENTRIES  # noqa: E402

FEW = {"max_evaluations": 1000}
LAW, SHARES = cradle.ImpulseCorrelation, cradle.EnergyDistribution
MODELS = {
    "kernel": [LAW(0.1, 0.05, excess="saturate"), LAW(1, excess="saturate", meeting=0.2), LAW(0)],
    "sequential": [cradle.SequentialCollisions(x, max_events=300) for x in ("left", "right")],
    "springs": [cradle.SpringChain(2.0, 1.5), cradle.SpringChain(1.0, 1.0)],
    "energy": [SHARES(1.0, **FEW)],
    "quadratic": [cradle.QuadraticDissipation(max_problems=50)],
}
REFUSED = """
solve ABACA --speed x; solve ABXCA; solve; solve AB --masses 1,2; solve --masses 1,-1,1
solve --masses 1,1,1 --restitution 1.2; solve --masses 1,1,1 --ratio 1.2; solve --masses 1,a,1
solve --masses 1,1,1 --velocities 1,0; solve ABC --json --csv; swing ABC --pull -1; fit none.csv
fit data/shots_synthetic.csv --known ABA=2; fit data/masses.csv; recommend ABACA --wanted hats
fit data/shots_synthetic.csv --known AB=0.1; film data/masses.csv --set BAC --masses 1,1,1
fit data/shots_synthetic.csv --predict ABACA; fit data/shots_template.csv --json; --help
"""


def told(thing) -> bytes:
    """A thing as bytes: arrays to the bit, results by all that they hold and show of themselves."""
    if isinstance(thing, np.ndarray) and thing.dtype != object:
        return f"{thing.dtype}{thing.shape}".encode() + thing.tobytes()
    if isinstance(thing, dict):
        return b"".join(told(key) + told(value) for key, value in thing.items())
    if isinstance(thing, (list, tuple, np.ndarray)):
        return b"".join(told(value) for value in thing)
    if hasattr(thing, "__dataclass_fields__"):
        return told([repr(thing), str(thing), getattr(thing, "_repr_html_", str)(), vars(thing)])
    if hasattr(thing, "get_figure"):
        file = io.BytesIO()
        thing.get_figure().savefig(file, format="svg", metadata={"Date": None})
        matplotlib.pyplot.close("all")
        return file.getvalue()
    return re.sub(" at 0x[0-9a-f]+", "", repr(thing)).encode()


def answer(call, *given, **named) -> bytes:  # or the words in which it refuses
    try:
        return told(call(*given, **named))
    except Exception as error:
        return told([type(error), str(error), getattr(error, "__notes__", ())])


def chains(models, sizes=(2, 3, 4, 5, 8), decades=6) -> Iterator[bytes]:
    rng = np.random.default_rng(31)
    for n in sizes:
        for m, v, e in zip(*random_chains(rng, 20, n, decades)[:3], strict=True):
            chain = cradle.Chain(m, v, e if rng.random() < 0.7 else 1.0)
            yield from (answer(cradle.collide, chain, model) for model in models)


def swings() -> Iterator[bytes]:
    rng, model = np.random.default_rng(7), MODELS["sequential"][0]
    for k in range(24):
        n, small = int(rng.integers(2, 6)), k % 3 > 0
        length = uniform(rng, 0.08, 0.12, n) if small else 0.1
        gaps, angle = 0.001 * small * (k % 4), ("full", "small")[small]
        hanging = cradle.Pendulums(length, gaps=gaps, damping=0.05 * (k % 5), angle=angle)
        chain = cradle.Chain(uniform(rng, 0.5, 2, n), np.zeros(n), 1.0 - 0.1 * (k % 4))
        start, times = np.sort(uniform(rng, -0.04, 0.04, n)), np.linspace(0, 3, 61)
        yield answer(cradle.swing, chain, model, start, times, pendulums=hanging)


def fitted() -> Iterator[bytes]:
    for name in ("shots_synthetic.csv", "shots_template.csv"):
        pairs = fit.restitution(shots := fit.read_shots(DATA / name))
        for found in (pairs, fit.ratio(shots, pairs)):
            yield told([shots, found, found.rows(), *found.plot()])
    tracks = fit.read_tracker(DATA / "video_synthetic.txt")
    yield from (answer(fit.velocities_from_tracks, tracks, striker=ball) for ball in range(3))


def refusals() -> Iterator[bytes]:
    for call, given in ENTRIES.items():
        yield from (answer(call, **given | {n: bad}) for n, bad in product(given, BAD))


def commanded() -> Iterator[bytes]:
    lines = [*(f"{name} --help" for name in main.commands), *examples()]
    for line in [*lines, *re.split("[;\n]", REFUSED.strip())]:
        line = re.sub(r"\b(shots|long).csv", "data/shots_synthetic.csv", line)
        line = re.sub(r"\bfilm.txt", "data/video_synthetic.txt", line)
        found = CliRunner().invoke(main, shlex.split(line))
        lasting = re.sub(r"\r[^\n]*points/s\]\s*", "", found.output)  # but for a progress bar
        yield told([found.exit_code, lasting, repr(found.exception)])


def shown() -> Iterator[bytes]:
    chain = cradle.Chain([1] * 3, [1, 0, 0])
    scenes = [(chain, MODELS["springs"][0]), cradle.paper_chain("AAAA"), cradle.paper_chain("BAB")]
    for trace in (cradle.collide(*scene) for scene in scenes):
        yield told([trace, trace.chain, trace.to_frame().to_json(double_precision=15)])
        yield told(impacts.velocities(trace))
        yield told(impacts.velocity_impulse(trace, 1))
    still, times = cradle.Chain([1] * 3, [0] * 3), np.linspace(0, 2, 21)
    run = cradle.swing(still, MODELS["sequential"][0], [-0.02, 0, 0], times)
    yield told([run, run.impacts, run.positions, run.velocities])
    yield told([animation.animate_swing(run, labels=["a"]), cradle.ratio_table().to_json()])
    for wanted, n in product(("velocities", "fastest ball", "times", "path"), (1, 10**6)):
        yield answer(cradle.recommend, chain, wanted=wanted, impacts=n, stiffness=1, ratios=0.1)


AREAS = {name: lambda m=models: chains(m) for name, models in MODELS.items()}
AREAS |= {name: lambda m=MODELS[name]: chains(m, (2, 3, 4), 2) for name in ("energy", "quadratic")}
AREAS |= {"swings": swings, "fits": fitted, "words": refusals, "shown": shown, "command": commanded}

if __name__ == "__main__":
    os.environ["CRADLE_KERNEL"] = "compiled"  # no seconds of work decide what runs
    matplotlib.rcParams.update({"svg.hashsalt": "census", "figure.max_open_warning": 0})
    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    os.chdir(tempfile.mkdtemp())
    Path("data").symlink_to(DATA)
    for area in sys.argv[1:] or AREAS:
        parts = list(AREAS[area]())
        digest = hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts))
        print(f"{area:10} {len(parts):6} {digest.hexdigest()[:16]}", flush=True)
