"""Chapter "Measure your own cradle" and its page on ratios: their text, by second routes."""

import functools
import math
import re

import numpy as np
import pytest
import real_cradles
from chapters import BOOK, Chapter, floats, number
from commands import call, film_of_lifted
from scipy.special import gammaincc, ndtri
from scipy.stats import norm
from stored import DATA, read
from truth import solve

from cradle.closed_form import one_collision_each, three_balls
from cradle.fit import read_shots

CHAPTER, RATIOS, TABLE = map(Chapter, ("measure", "measure_ratios", "table_2"))
GLUED = CHAPTER.glued | TABLE.glued


def test_every_page_that_shows_data_calls_them_synthetic():
    for page, name in ((CHAPTER, "fig-tracks"), (RATIOS, "fig-fit"), (RATIOS, "fig-check")):
        caption = page.cells[name].metadata.mystnb.figure.caption
        assert "synthetic" in caption.lower(), name


def test_error_of_a_line_by_least_squares():
    def error(frames, rate):
        matrix = np.stack([np.ones(frames), np.arange(frames) / rate], axis=1)
        return 0.4 * math.sqrt(np.linalg.inv(matrix.T @ matrix)[1, 1])

    assert f"{error(12, 240):.0f}" == GLUED["error"]
    # Of a pendulum, for a quarter of its swing.
    omega = math.sqrt(9.81 / 0.3)
    assert f"{math.pi / 2 / omega:.2f}" == GLUED["quarter"]
    times = np.loadtxt(DATA / "row_film_synthetic.txt", skiprows=3, encoding="utf-8")[:, 0]
    assert f"{np.ptp(times) / 2:.2f}" == GLUED["quarter"]
    said = re.findall(r"± ([\d.]+)", CHAPTER.printed("tracks"))
    assert [1000 * float(x) for x in said] == pytest.approx(
        [float(GLUED["error-240"])] * 5, abs=0.11
    )
    shot = [line.split(",") for line in CHAPTER.printed("gaps-fit").splitlines()[1:]]
    assert said == [row[7] for row in shot]
    mass, *speeds = np.array([row[4:7] for row in shot], float).T  # with a digit more
    balls = re.findall(r": ([\d.]+) m/s before, +(-?[\d.]+)", CHAPTER.printed("tracks"))
    np.testing.assert_allclose(np.array(balls, float).T, speeds, rtol=0, atol=5.6e-4)
    before, after = (1000 * mass @ v for v in speeds)
    assert f"{before:.1f} g m/s before, {after:.1f} after" in CHAPTER.printed("tracks")
    pulls = np.rad2deg(np.arccos(1 - np.array([0.35, 0.7, 1.4]) ** 2 / (2 * 9.81 * 0.3)))
    assert [int(x) for x in re.findall(r"\d+", GLUED["pulls"])] == np.rint(pulls).tolist()
    t = np.arange(0, math.pi / 2 / omega, 1 / 240)
    matrix = np.stack([np.ones(len(t)), np.sin(omega * t) / omega], axis=1)
    assert f"{0.4 * math.sqrt(np.linalg.inv(matrix.T @ matrix)[1, 1]):.1f}" == GLUED["error-240"]
    assert len(t) == int(GLUED["quarter-frames"])
    assert f"{error(len(t), 240):.1f}" == GLUED["line-240"]


def test_third_digit_by_the_closed_form():
    """Where balls collide once each: sensitivities from the formulas, slope by slope."""
    study = {row["triplet"]: row for row in read("fit_precision.csv")}
    mass = {"A": 0.045, "B": 0.053, "C": 0.053, "D": 0.166}
    e = {"AB": 0.53, "BC": 0.28, "AC": 0.31, "AA": 0.97, "BB": 0.36}
    checked = 0
    for name in ("ABA", "ABC", "CBA", "ACA", "AAB", "BBA"):
        m = [mass[letter] for letter in name]
        losses = [e["".join(sorted(name[:2]))], e["".join(sorted(name[1:]))]]
        true, step = float(study[name]["ratio"]), 1e-6
        if not one_collision_each(m, [1, 0, 0], losses, true):
            continue
        checked += 1
        low, here, high = three_balls(
            m, [1, 0, 0], [losses] * 3, np.array([true - step, true, true + step])
        )
        slope = (high - low) / (2 * step)
        seen = slope @ slope - (slope @ here) ** 2 / (1 + here @ here)
        assert float(study[name]["sensitivity"]) == pytest.approx(math.sqrt(seen), rel=0.01)
        needed = 0.0005 / 1.96 * math.sqrt(20 * seen)
        assert float(study[name]["third_digit"]) == pytest.approx(needed, rel=0.01)
    assert checked >= 4


def test_masses_within_half_a_gram():
    assert float(GLUED["half-gram-CCA"]) == pytest.approx(45.5 / 98, abs=1e-4)
    assert float(GLUED["half-gram-CCA"]) > 0.462 > 45 / 98
    assert float(GLUED["half-gram-DBB"]) < 0.710


def test_power_by_theory():
    (row,) = read("fit_precision.csv", triplet="AAA")
    error = 0.01 / (float(row["sensitivity"]) * math.sqrt(10)) * math.sqrt(2)
    limit = norm.ppf(0.975) * error
    power = norm.sf((limit - float(row["detectable"])) / error)
    assert power == pytest.approx(0.8, abs=0.01)


def test_frames_of_the_laboratory():
    """By Eq. (measure-error) in whole numbers."""
    assert next(n for n in range(3, 40) if n * (n * n - 1) >= 12 * (1 * 120 / 20) ** 2) == 8
    text = (BOOK / "instructors.md").read_text(encoding="utf-8")
    assert "At 120 frames a second and marks off by 1 mm: eight for an error of 20 mm/s" in text
    film = Chapter("real_cradles").glued  # the numbers that a class is told
    for told in (f"{film['slow-off']} % of", f"up to {film['pairs-off']} %"):
        assert told in text
    assert f"with {round(float(film['fourth']))} % of the striker's speed" in text
    assert film["three-ratios"] == "0.05, 0.13, 0.14"
    assert "a ratio of 0.05 to 0.15" in text


def test_prediction_of_a_longer_row():
    """The medians by the independent solver, and the shots beside them."""
    found = RATIOS.printed("show-pairs") + RATIOS.printed("show-ratios")
    told = {name: float(x) for name, x in re.findall(r"(?m)^\w+ (\w+) = ([\d.]+)", found)}
    rows = read("shots_synthetic.csv", set="ABACA")
    columns = ("mass", "before", "after", "sigma", "sigma_before")
    mass, before, after, sigma, sigma_before = (
        floats(row[name] for row in rows).reshape(-1, 5) for name in columns
    )
    losses = [told["AB"], told["AB"], told["AC"], told["AC"]]
    ratios = [
        [told[name] for name in way] for way in (["ABA", "BAC", "ACA"], ["ABA", "CAB", "ACA"])
    ]
    done = solve(mass[0].tolist(), [1.0, 0, 0, 0, 0], losses, *ratios, number=float)
    printed = [line.split() for line in RATIOS.printed("check").splitlines()[2:7]]
    median, low, high = floats(x for line in printed for x in line[2:]).reshape(5, 3).T
    assert floats(done.velocities) == pytest.approx(median, abs=1.5e-3)
    assert ((low < median) & (median < high)).all()
    speed = before[:, :1]
    error = np.hypot(sigma, speed * (high - low) / 3.92)
    off = (after - speed * median) / np.hypot(error, median * sigma_before[:, :1])
    said = re.findall(r"\d+", RATIOS.printed("check-how"))
    assert [int(x) for x in said] == pytest.approx([np.square(off).sum(), off.size], abs=4.5)


def test_intervals_hold_what_made_the_shots():
    made = {"AB": 0.53, "AC": 0.31, "ABA": 0.127, "BAC": 0.088, "CAB": 0.499, "ACA": 0.262}
    found = RATIOS.printed("show-pairs") + RATIOS.printed("show-ratios")
    told = re.findall(r"(?m)^\w+ (\w+) = [\d.]+ \[([\d.]+), ([\d.]+)\]", found)
    held = [float(low) <= made.pop(name) <= float(high) for name, low, high in told]
    assert not made
    assert (number(RATIOS.glued["inside"]), number(RATIOS.glued["intervals"])) == (sum(held), 6)


def test_gaps_that_one_speed_does_not_tell_apart_and_another_speed_does():
    """Three sets that fit at 0.7 m/s, by SciPy's integration: alike there, apart at 0.35."""
    lines = re.findall(r"gap_\d\d = ([\d.]+) \[([\d.]+), ([\d.]+)\]", CHAPTER.printed("gaps-law"))
    told, low, high = np.array(lines, float).T
    assert len(told) == 3
    assert ((low < [3, 1.5, 0.5]) & (high > [3, 1.5, 0.5])).all()
    assert (high - low).max() / 2 == pytest.approx(float(GLUED["gap-error"]), abs=0.0101)
    assert np.abs(told - [3, 1.5, 0.5]).max() < float(GLUED["gap-error"])
    stiffness = 4 / 3 * 210e9 / (2 * (1 - 0.3**2)) * math.sqrt(0.01109 / 2)

    def strike(gaps, speed, loss=2e-7):
        unit = (0.0448 * speed**2 / stiffness) ** 0.4
        gaps = [0.0, *(1e-6 * np.array(gaps) / unit)]
        return real_cradles.spheres(np.eye(5)[0], gaps, loss * speed / unit)

    sets = [3.715, 1.374, 0.504], [3.719, 1.669, 0.410], [3.000, 1.500, 0.500]
    same, slower = (np.array([strike(one, speed) for one in sets]) for speed in (0.7, 0.35))
    assert np.ptp(same, axis=0).max() < 5e-4  # numbers of two digits
    apart = np.abs(slower[:, None] - slower).max(axis=-1)[np.triu_indices(len(sets), 1)]
    assert apart.min() > 2e-3  # the error of a reading


def test_the_left_out_set_by_another_integration():
    """Three balls lifted, two shots at each of three speeds, as the page makes and judges them."""
    found = CHAPTER.printed("gaps-law") + CHAPTER.printed("gaps-found")
    stiffness = 4 / 3 * 210e9 / (2 * (1 - 0.3**2)) * math.sqrt(0.01109 / 2)

    @functools.cache
    def struck(apart, gap, viscosity, speed):
        unit = (0.0448 * speed**2 / stiffness) ** 0.4
        gaps = [1e-6 * x / unit for x in (apart, apart, 0, gap)]  # ball 3 strikes wherever it is
        before = (np.arange(5) < 3).astype(float)
        return speed * real_cradles.spheres(before, gaps, 1e-9 * viscosity * speed / unit)

    speeds = [0.35, 0.35, 0.7, 0.7, 1.4, 1.4]
    sigma = np.full((6, 5), float(GLUED["error-240"]) / 1000)
    noise = sigma * ndtri(np.random.default_rng(3).random(sigma.shape))
    film = noise + [struck(600, 0.5, 200, speed) for speed in speeds]
    numbers = [float(x) for x in re.findall(r"(?:apart|gap_45|viscosity) = ([\d.]+)", found)]
    judged = {
        law: (float(fit) * (free := 60 - int(count)), free, float(test) * 30, verdict)
        for law, count, fit, test, verdict in re.findall(
            r"(?m)^ *(\S.*?) +(\d) +([\d.]+) +([\d.]+) +(yes|no)$", found
        )
    }
    for law, three in (("gaps", numbers[:3]), ("touching spheres", [900, 0, 180])):
        *_, told, _ = judged[law]
        off = (film - [struck(*three, speed) for speed in speeds]) / sigma
        # Of touching spheres the page prints no numbers: none is near enough.
        right = law == "gaps"
        assert (off**2).sum() == pytest.approx(told, rel=0.02 if right else 0.3)
        assert off.size == 30
    # The others miss both: far above what a right law has by chance.
    assert len(judged) == 5
    for law, (fit, n, test, verdict) in judged.items():
        passes = gammaincc(n / 2, fit / 2) > 0.05 and gammaincc(30 / 2, test / 2) > 0.05
        assert (verdict == "yes") == passes == (law == "gaps")
    # Ratios see of the same film balls 3, 4 and 5 only; then balls 2 and 1 follow, pair by pair.
    lossy, tried = 0.985, np.linspace(0.05, 0.25, 81)

    def by_ratio(ratio, speed):
        v = np.array([speed] * 3 + [0.0] * 2)
        v[2:] = three_balls([1] * 3, v[2:], [[lossy] * 2], np.array([ratio]))[0]
        for k in (1, 0):
            while True:
                closing = [c for c in range(k, 4) if v[c] > v[c + 1] + 1e-12]
                if not closing:
                    break
                c = closing[0]
                mean, half = (v[c] + v[c + 1]) / 2, lossy * (v[c] - v[c + 1]) / 2
                v[c], v[c + 1] = mean - half, mean + half
        return v

    off = [
        sum((((shot - by_ratio(x, u)) / sigma[0]) ** 2).sum() for shot, u in zip(film, speeds))
        for x in tried
    ]
    one, four = float(GLUED["ratio-one"]), float(GLUED["ratio-four"])
    for ratio, law in ((one, "one ratio"), (four, "a ratio each")):
        *_, told, _ = judged[law]
        rounded = np.abs(tried - ratio) < 0.006
        ends = np.array(off)[rounded]
        assert 0.97 * ends.min() < told < 1.03 * ends.max(), law
    # Two balls with this loss alone.
    unit = (0.0448 * 0.7**2 / stiffness) ** 0.4
    first, second = real_cradles.spheres([1.0, 0.0], [0.0], 2e-7 * 0.7 / unit)
    CHAPTER.tells({"viscous-e": second - first})


def test_at_ratios_below_that_of_bac_the_first_two_balls_collide_twice():
    """So its interval is lopsided: the outcome changes less there."""
    masses, losses = [0.053, 0.045, 0.053], [0.5282, 0.3115]
    here = {}
    for ratio in (0.07, 0.08, 0.09, 0.1):
        end = solve(masses, [1.0, 0, 0], losses, ratio, number=float)
        here[ratio] = np.array(end.velocities)
        count = sum(event == ("maximum_compression", 0) for event in end.events)
        assert count == (2 if ratio < 0.0859 else 1)
    slow, quick = (np.linalg.norm(here[b] - here[a]) for a, b in ((0.07, 0.08), (0.09, 0.1)))
    assert slow < 0.75 * quick


def test_the_commands_of_the_page_run_one_after_the_other(tmp_path, monkeypatch):
    """Films make tables; to the second the shots of the page are added, and all is fitted."""
    told = (page.cells["commands"].source for page in (CHAPTER, RATIOS))
    shown = "".join(re.findall(r"(?s)```text\n(.*?)```", "\n".join(told)))
    lines = shown.replace("\\\n", "").splitlines()  # a backslash ends a line that goes on
    monkeypatch.chdir(tmp_path)
    film = (DATA / "video_synthetic.txt").read_text(encoding="utf-8")
    (tmp_path / "bac.txt").write_text(film, encoding="utf-8")
    for lifted, name in enumerate(("one.txt", "two.txt", "three.txt"), 1):
        (tmp_path / name).write_text(film_of_lifted(5, lifted), encoding="utf-8")
    told = {}
    for line in lines:
        command, _, target = re.fullmatch(r"cradle (.*?)(?: (>>?) (\S+))?", line).groups()
        if command.startswith("fit-swing"):
            continue  # a film of a swing is fitted elsewhere
        if "fit all.csv" in command:
            _, *more = (DATA / "shots_synthetic.csv").read_text(encoding="utf-8").split("\n", 2)
            with (tmp_path / "all.csv").open("a", encoding="utf-8") as file:
                file.write(more[1])
        told[line] = call(command)
        if target:
            with (tmp_path / target).open("a", encoding="utf-8") as file:
                file.write(told[line])
    table = (tmp_path / "all.csv").read_text(encoding="utf-8").splitlines()
    assert table[0] == "set,shot,ball,type,mass,before,after,sigma,sigma_before"
    assert [line[:7] for line in table[1:4]] == ["BAC,bac"] * 3
    row = read_shots(tmp_path / "my_row.csv")
    for lifted in (1, 2, 3):
        one = row[f"{lifted} lifted"]
        assert (one.before[0] > 0.6).tolist() == [k < lifted for k in range(5)]
        assert (one.after[0] > 0.6).tolist() == [k >= 5 - lifted for k in range(5)]
    (last,) = (words for line, words in told.items() if "all.csv" in line and " fit " in line)
    assert "ABACA" in last
    assert (tmp_path / "fit.png").is_file()
