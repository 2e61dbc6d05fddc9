"""The judge: answers of the package against the textbook's rules over decimals of 100 digits.

Usage::

    python benchmarks/judge.py                             # a hundred chains of every family
    python benchmarks/judge.py --family losses --count 10000 --seed 7
    python benchmarks/judge.py --count 250 --seed {5001..5028} --write    # data/judge.csv, an hour
    python benchmarks/judge.py --family wide --count 250 --seed {5001..5028} --write  # a row of it
    python benchmarks/judge.py --short --family wide --count 120000 --write  # data/judge_short.csv

An answer is wrong if it differs by more than 1e-9 of the largest speed from an exact run that ends
within 600 events, and after no more of them at twice the digits.  A float means what it prints as
if that is short, see `meaning`: ties of an exact run are those of the decimals that a reader sees.
Wrong chains are printed, as small and plain as they stay wrong.  Where the exact run has no end,
see `second_opinion`; a short run leaves out all chains that do not end within 100 events.
"""

import contextlib
import decimal
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from decimal import Decimal
from itertools import product
from typing import NamedTuple

import pandas as pd
import truth
from families import JUDGED, family
from problem import Problem
from stored import options
from truth import meaning

from cradle import ImpactNotFinished, post_impact_velocities, textbook
from cradle.trace import ImpactNotCertified

DIGITS, EVENTS, SHORT, WRONG = 100, 600, 100, 1e-9
LONGEST = 200_000  # events of the package: far beyond those of an exact run that ends
LIMIT = 1e-6  # by which answers may differ where an infinite sequence was taken to its limit
DOUBTFUL = ("wrong", "other reading", "open", "unfinished", "unlike them")  # printed
ROUNDINGS = 5 * Decimal(2) ** -52  # four, and that of comparing them
TASK = 50  # chains of one task of the pool


class Exact(textbook.Impact):
    """The textbook's impact: zero and equal is what is so to six tenths of the digits; no path."""

    def __init__(self, *given):
        super().__init__(*given)
        self.tie = 10 ** (6 * decimal.getcontext().prec // 10)
        wider = Decimal(1) / self.tie / self.small
        self.small, self.last_digits = self.small * wider, self.last_digits * wider

    def record(self, kind, c):
        self.events.append((kind, c))


class InForce(Exact):
    """The same, with R7 as it is meant: a ratio that roundings keep from a bound is on it.

    Of any bound, whenever it comes into force; `on_bounds` sees those of the start alone.
    """

    def ratios_in_force(self, inner):
        kept, self.small = self.small, ROUNDINGS
        try:
            return super().ratios_in_force(inner)
        finally:
            self.small = kept


def exact(problem, read=meaning, *, events=EVENTS, twice=False, impact=Exact):
    """The impact by the rules alone; None if the sequence does not end within so many events.

    100 digits; five times as many where products of small ratios matter, more than the package then
    takes for the same rules; twice as many if asked.
    """
    tiny = any(0 < ratio < 1e-4 for ratio in (*problem.forward, *problem.backward))
    with decimal.localcontext(prec=DIGITS * (5 if tiny else 1) * (2 if twice else 1)):
        try:
            return problem.solve(textbook.solve, number=read, max_events=events, impact=impact)
        except textbook.EventLimit:
            return None


def on_bounds(problem):
    """The chain with its ratios within 4 roundings of their bounds (Eq. 53, mirrored) on them.

    Of the bounds as they are, or as they are drawn: in floats, from the ratio given beyond, which
    leaves few digits of what it lacks to 1.  A bound that comes into force later, when a
    neighbour has ended, is not looked for.
    """

    def one_way(masses, ratios):
        found, onward, seen = [], Decimal(0), 0.0
        m = [meaning(x) for x in masses]
        for here, beyond, ratio in reversed(list(zip(m[1:], m[2:], map(meaning, ratios)))):
            bound = beyond / (beyond + here * (1 - onward))
            drawn = 1 / (1 + float(here) / float(beyond) * (1 - seen))
            off = min(abs(ratio / bound - 1), abs(float(ratio) / drawn - 1))
            found.insert(0, bound if off < 4 * Decimal(2) ** -52 else ratio)
            onward = min(found[0], bound)  # what lies above is held at it
            seen = float(ratio if found[0] <= bound else bound)
        return found

    with decimal.localcontext(prec=4 * DIGITS):
        forward = one_way(problem.masses, problem.forward)
        backward = one_way(problem.masses[::-1], problem.backward[::-1])[::-1]
    return problem._replace(forward=forward, backward=backward)


def off(problem, one, other):
    """How far two outcomes are apart, as a part of the largest speed before the impact."""
    most = max(abs(a - Decimal(b)) for a, b in zip(map(Decimal, one), other, strict=True))
    return float(most / (Decimal(max(map(abs, problem.velocities))) or 1))


class Verdict(NamedTuple):
    """One of `WORDS`, and the distance from the truth."""

    word: str
    off: float = 0.0


#: Where the exact run ends: "other reading" is right for the exact values of all floats, or with
#: ratios beside their bounds; "open" hangs on more digits; "unfinished" has no answer.
ENDS = ["right", "wrong", "other reading", "open", "unfinished"]
#: Where it has no end: who agrees with the answer; "given up" has no answer.
ENDLESS = ["as 50 digits", "unlike them", "as relations", "nobody knows", "given up"]
WORDS = ENDS + ENDLESS
LEFT_OUT = "endless"  # of a short run, in the place of all of these


def batch(problem):
    """The package's velocities, of a batch; None if it gives none."""
    options = {"excess": "saturate", "max_events": LONGEST}
    with contextlib.suppress(ImpactNotFinished, ImpactNotCertified):
        return problem.solve(post_impact_velocities, **options).tolist()


def single(problem):
    """The same, of `collide`; with all of its path, whose cut would be warned of."""
    with contextlib.suppress(ImpactNotFinished, ImpactNotCertified):
        return problem.collide(record=True, max_events=LONGEST).velocities.tolist()


def judge(problem, *ask, events=EVENTS):
    """The verdict on one chain, by the worse of its answers; `LEFT_OUT` if that must be others'."""
    given = [answer(problem) for answer in ask or (batch, single)]
    meant = on_bounds(problem)
    right = exact(meant, events=events)
    if right is None:
        return Verdict(LEFT_OUT)
    if None in given:
        return Verdict("unfinished")
    far = max(off(problem, one, right.velocities) for one in given)
    if far <= WRONG:
        return Verdict("right", far)
    again = exact(meant, events=len(right.events) + 1, twice=True)
    if again is None or len(again.events) > len(right.events):
        return Verdict(LEFT_OUT)  # it ended where its digits did
    if off(problem, again.velocities, right.velocities) > WRONG:
        return Verdict("open", far)
    held = exact(problem, impact=InForce)
    if held and (far := max(off(problem, one, held.velocities) for one in given)) <= WRONG:
        return Verdict("right", far)
    for other in exact(problem, Decimal), exact(problem):
        if other and max(off(problem, one, other.velocities) for one in given) <= WRONG:
            return Verdict("other reading", far)
    return Verdict("wrong", far)


def second_opinion(problem):
    """On a chain whose exact run has no end: by rule R9 at fifty digits, then by relations."""
    given = batch(problem)
    if given is None:
        return Verdict("given up")
    with decimal.localcontext(prec=50), contextlib.suppress(truth.EventLimit):
        limit = on_bounds(problem).exact(2000, number=meaning).velocities
        far = off(problem, given, limit)
        return Verdict("as 50 digits" if far <= LIMIT else "unlike them", far)
    far = [off(problem, given, other) for other in seen_otherwise(problem)]
    word = "as relations" if far and max(far) <= LIMIT else "nobody knows"
    return Verdict(word, max(far, default=1.0))


def seen_otherwise(problem):
    """Answers for the same chain seen from elsewhere, where these inputs mean the very same."""
    others = [
        (problem.boosted(4.0), lambda v: [x - 4 for x in v]),
        (problem.in_units(1.0, 2.0), lambda v: [x / 2 for x in v]),
    ]
    if sum(a > b for a, b in zip(problem.velocities, problem.velocities[1:])) == 1:
        others.append((problem.mirrored(), lambda v: [-x for x in reversed(v)]))
    here = [meaning(v) for v in problem.velocities]
    for other, back in others:
        given = batch(other)
        if given is not None and back([meaning(v) for v in other.velocities]) == here:
            yield back(given)


def shrunk(problem, word, *ask):
    """The chain with as few balls, and then as plain numbers, as leave the verdict what it is."""

    def smaller(given):
        if len(given.masses) > 2:
            for part in slice(1, None), slice(None, -1):
                yield Problem(*(values[part] for values in given[:5]), given.meeting)
        for k, plain in enumerate([1.0, 0.0, 1.0, 0.0, 0.0]):
            for i, x in enumerate(given[k]):
                if x != plain:
                    values = [*given[k][:i], plain, *given[k][i + 1 :]]
                    yield given._replace(**{given._fields[k]: values})

    for other in smaller(problem):
        if judge(other, *ask).word == word:
            return shrunk(other, word, *ask)
    return problem


def task(name, count, seed, short):
    """Judge some chains; counts, and those that are doubtful."""
    counts, found = Counter(), []
    for problem in family(name, count, seed):
        verdict = judge(problem, events=SHORT if short else EVENTS)
        if verdict.word == LEFT_OUT and not short:
            verdict = second_opinion(problem)
        counts[verdict.word] += 1
        if verdict.word in DOUBTFUL:
            least = shrunk(problem, verdict.word) if verdict.word in ENDS else problem
            found.append((name, verdict, least))
    return name, counts, found


def run(names, count, *seeds, short=False, workers=2):
    """Judge so many chains of each family for each seed; counts by family, and what is wrong."""
    counts, found = {name: Counter() for name in names}, []
    tasks = [  # each with a seed of its own
        (name, min(TASK, count - start), seed * 1_000_003 + start, short)
        for seed, name, start in product(seeds, names, range(0, count, TASK))
    ]
    with ProcessPoolExecutor(workers, initializer=os.nice, initargs=(10,)) as pool:
        for name, part, wrong in pool.map(task, *zip(*tasks, strict=True)):
            counts[name].update(part)
            found += wrong
    return counts, found


def main():
    parser = options(__doc__)
    parser.add_argument("--family", choices=JUDGED, action="append")
    parser.add_argument("--count", type=int, default=100, help="chains of each family")
    parser.add_argument("--seed", type=int, nargs="+", default=[1], help="one run for each")
    parser.add_argument("--short", action="store_true", help="only chains that soon end")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--write", action="store_true", help="write the counts, as judge*.csv")
    given = parser.parse_args()
    names, short = given.family or list(JUDGED), given.short
    counts, found = run(names, given.count, *given.seed, short=short, workers=given.workers)
    words = [*ENDS, LEFT_OUT] if short else WORDS
    table = pd.DataFrame(counts, words).fillna(0).astype(int).T
    print(table.to_string())
    if given.write:
        path = given.output / ("judge_short.csv" if short else "judge.csv")
        if given.family and path.exists():  # the other rows stay
            stored = pd.read_csv(path, index_col="family")
            table = table.reindex(list(JUDGED)).fillna(stored).dropna().astype(int)
        table.to_csv(path, index_label="family", lineterminator="\n")
    for name, verdict, problem in found:
        print(f"\n{name}: {verdict.word}, off by {verdict.off:.1e}\n{problem!r}")


if __name__ == "__main__":
    main()
