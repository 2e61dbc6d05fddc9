"""Read the velocities of a filmed Newton's cradle: every ball before and after every strike.

`python benchmarks/film_reading.py newtons_cradle.mp4` writes `film_reading.csv` in minutes, where
OpenCV is installed; `data/README.md` says where the film was found, and how it is read.  Places are
guessed by correlation, then fitted, then fitted again from what the arcs predict.
"""

from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from pathlib import Path

import cv2
import numpy as np
from film_arcs import LENGTH, RELEASES, REST, crossing, predict, strikes, summary
from scipy.ndimage import median_filter
from stored import options, write

RADIUS, EDGE = 25.75, 0.7  # of a ball; its softness
X0, X1, Y0, Y1 = 330, 1120, 400, 600  # the strip where balls move
POSTS = ((428, 487), (921, 975))  # hide balls
REFERENCE, HALF = 60, 48
FIXED = ((35, 600, 400, 520), (30, 180, 890, 985), (540, 615, 380, 860))
COLUMNS = "release strike ball striker speed before sigma_before after sigma_after"

film = {}  # frames, drift, background, template: shared with the workers by fork


def read(path):
    capture, frames = cv2.VideoCapture(str(path)), []
    while (got := capture.read())[0]:
        frames.append(got[1])
    film["frames"] = np.array(frames)
    for part in (drift, background, template):
        film[part.__name__] = part(film["frames"])


def drift(frames):
    """Return how far the standing parts have moved since the reference frame, (K, 2)."""
    shifts = []
    for top, bottom, left, right in FIXED:
        parts = (frame[top:bottom, left:right] for frame in frames)
        grey = [cv2.cvtColor(part, cv2.COLOR_BGR2GRAY).astype("f4") for part in parts]
        window = cv2.createHanningWindow(grey[0].shape[::-1], cv2.CV_32F)
        first = grey[REFERENCE]  # copied, as OpenCV multiplies its arguments by the window in place
        shifts.append([cv2.phaseCorrelate(first.copy(), g.copy(), window)[0] for g in grey])
    shifts = np.array(shifts)
    return median_filter((shifts - shifts[:, [REFERENCE]]).mean(0), (5, 1))


def moved(picture, shift, back=False):
    flags = cv2.INTER_LINEAR | (cv2.WARP_INVERSE_MAP if back else 0)
    matrix = np.float32(np.column_stack([np.eye(2), shift]))
    size = picture.shape[1::-1]
    return cv2.warpAffine(picture, matrix, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)


def background(frames):
    """Return the strip without balls: the median; where balls hang, what lies left and right."""
    free = [*range(176, 262, 2), *range(424, 520, 2), *range(712, 880, 2)]
    strip = np.array([moved(frames[i][Y0:Y1, X0:X1], film["drift"][i], True) for i in free])
    order = np.argsort(strip.sum(3, dtype="i4"), 0)[len(free) // 2 : int(0.9 * len(free))]
    bright = np.take_along_axis(strip, order[..., None], 0).mean(0)
    empty = np.median(strip, 0)
    left, right = (empty[:, a : a + 15].mean(1, keepdims=True) for a in (205, 545))
    part = np.linspace(0, 1, 341)[:, None]
    fill = left * (1 - part) + right * part
    shade = bright[60:76, 212:553].mean(0) - fill[60:76].mean(0)
    fill[70:150] += shade * (np.arange(80, 0, -1) / 80)[:, None, None]
    empty[70:150, 212:553] = fill[70:150]
    return empty.astype("f4")


def template(frames):
    """Return a resting ball, coloured, times its opacity, and the opacity, (97, 97, 4)."""
    ball = np.zeros((61, 61, 3), "f4")
    for i in range(20, 100, 4):
        for x in (604, 655, 706.5, 758, 809.5):
            at = (x + film["drift"][i, 0], 516.5 + film["drift"][i, 1])
            ball += cv2.getRectSubPix(frames[i], (61, 61), at) / 100
    y, x = np.mgrid[-HALF : HALF + 1, -HALF : HALF + 1]
    opacity = (1 / (1 + np.exp((np.hypot(x, y) - RADIUS) / EDGE)))[..., None].astype("f4")
    wide = cv2.copyMakeBorder(ball, *[HALF - 30] * 4, cv2.BORDER_REPLICATE)
    return np.concatenate([wide * opacity, opacity], 2)


def blurred(blur, slope):
    """Return the template smeared over `blur` pixels along a slope (radians)."""
    if blur < 0.5:
        return film["template"]
    half = int(blur / 2) + 2
    kernel = np.zeros((2 * half + 1,) * 2, "f4")
    for part in np.linspace(-0.5, 0.5, 41) * blur:
        x, y = half + part * np.cos(slope), half - part * np.sin(slope)
        i, j = int(x), int(y)
        a, b = x - i, y - j
        kernel[j : j + 2, i : i + 2] += np.outer([1 - b, b], [1 - a, a])
    return cv2.filter2D(film["template"], -1, kernel / kernel.sum(), borderType=cv2.BORDER_CONSTANT)


def placed(ball, at, shape):
    matrix = np.float32(np.column_stack([np.eye(2), np.subtract(at, HALF)]))
    return cv2.warpAffine(ball, matrix, shape[::-1], flags=cv2.INTER_CUBIC)


def refine(i, release, guess):
    """Fit the places of five balls in a frame, from a guess (5, 3): x, y, blur; rows of a table."""
    shift, guess = film["drift"][i], np.array(guess, float)
    empty, image = moved(film["background"], shift), film["frames"][i][Y0:Y1, X0:X1].astype("f4")
    seen = np.ones(empty.shape[:2], bool)
    seen[149:] = False
    for post in POSTS:
        left, right = (int(side + shift[0] - X0) for side in post)
        seen[:, left : right + 1] = False
    slopes = np.arcsin(np.clip((guess[:, 0] - shift[0] - REST) / LENGTH, -0.9, 0.9))
    balls = [blurred(b, s) if np.isfinite(s) else None for b, s in zip(guess[:, 2], slopes)]
    misfit, part = np.full(5, np.nan), np.zeros(5)
    for k in [*range(5)] * 3:
        if balls[k] is not None:
            guess[k, :2], misfit[k], part[k] = fit_ball(k, guess, balls, (empty, image, seen))
    guess[:, :2] -= shift
    return np.column_stack([[i] * 5, [release] * 5, range(1, 6), guess, misfit, part])


def fit_ball(k, guess, balls, strip):
    """Return place, misfit and visible part of one ball, the others where they are."""
    x, y, blur = guess[k]
    m, wide = 36 + int(blur / 2), strip[0].shape[1]
    a, b = (int(np.clip(x - X0 + side, 0, wide)) for side in (-m, m + 1))
    c, d = int(max(y - Y0 - 31, 0)), int(min(y - Y0 + 32, Y1 - Y0))
    if b - a < 20:
        return (x, y), np.nan, 0.0
    empty, image, mask = (picture[c:d, a:b] for picture in strip)
    corner, shape = (X0 + a, Y0 + c), (d - c, b - a)
    # Blurred neighbours never overlap at one instant: opacities add.
    others = np.zeros((*shape, 4), "f4")
    for j in range(5):
        if j != k and balls[j] is not None and abs(guess[j, 0] - x) < 140:
            others += placed(balls[j], guess[j, :2] - corner, shape)
    opacity = placed(balls[k], guess[k, :2] - corner, shape)[..., 3]
    part = opacity[mask].sum() / np.pi / RADIUS**2
    if part < 0.15:
        return (x, y), np.nan, part

    def residual(p):
        drawn = others + placed(balls[k], p - corner, shape)
        through = np.clip(1 - drawn[..., 3:], 0, 1)
        return (empty * through + drawn[..., :3] - image)[mask].ravel() / 12

    return *gauss_newton(residual, guess[k, :2]), part


def gauss_newton(residual, p, step=0.4):
    """Least squares with Huber weights, central differences; the place and the misfit."""
    for _ in range(7):
        r = residual(p)
        weight = (1 + r * r) ** -0.5
        slope = [(residual(p + e) - residual(p - e)) / (2 * step) for e in step * np.eye(2)]
        full = np.linalg.lstsq(np.transpose(slope) * weight[:, None], -r * weight, rcond=None)[0]
        p = p + (change := np.clip(full, -4, 4))
        if np.abs(change).max() < 0.005:
            break
    return p, 12 * np.sqrt(np.mean(residual(p) ** 2))


def detect(i, release):
    """Return a guess of the five places from correlations along the path, in their order."""
    shift, row = film["drift"][i], film["frames"][i][Y0 - 10 : Y1 - 10, 300:1170].astype("f4")
    xs = np.arange(350, 1110)
    best, blur_of = np.full(len(xs), -1.0, "f4"), np.zeros(len(xs))
    y = (103 + np.sqrt(LENGTH**2 - np.min((xs[:, None] - shift[0] - REST) ** 2, 1))).astype(int)
    for blur in (0, 15, 27):
        ball = blurred(blur, 0.0)
        sight = ball[..., :3] + (1 - ball[..., 3:]) * np.float32([165, 178, 185])
        score = cv2.matchTemplate(row, sight[18:79, 8:89].astype("f4"), cv2.TM_CCOEFF_NORMED)
        rows = np.clip(y[:, None] + np.arange(-30, 5) - (Y0 + 20), 0, len(score) - 1)
        value = score[rows, (xs - 340)[:, None]].max(1)
        blur_of[value > best], best = blur, np.maximum(best, value)
    start, half, *_ = RELEASES[release]
    to_the_right = np.floor((i - start) / half) % 2
    place = xs - shift[0]
    best[place < 560 if to_the_right else place > 880] = -1
    for left, right in POSTS:
        best[(place > left) & (place < right) & (best > 0.45)] = 0.45
    if (release == 1 and i > 268) or i - start < (5 if release > 1 else 0):
        best[place > 975] = -1
    total, chosen = best.copy(), []
    for _ in range(4):  # the best sum of five in order, 49 pixels apart at least
        reach = np.maximum.accumulate(total)
        first = np.searchsorted(reach, reach)  # where this maximum was reached
        total = np.full(len(xs), -9.0)
        total[49:] = best[49:] + reach[:-49]
        chosen.append(np.pad(first[:-49], (49, 0)))
    path = [int(total.argmax())]
    for back in chosen[::-1]:
        path.append(back[path[-1]])
    at = np.array(path[::-1])
    y = 103 + np.sqrt(LENGTH**2 - np.minimum((xs[at] - shift[0] - REST) ** 2, 400**2)) + shift[1]
    return np.column_stack([np.where(best[at] > 0.15, xs[at], np.nan), y, blur_of[at]])


def rows():
    for release, (start, half, first, last) in RELEASES.items():
        times, frames = np.arange(start, last, half)[:-1], range(first, last + 1)
        guesses = [detect(i, release) for i in frames]
        with ProcessPoolExecutor() as pool:
            for _ in range(3):  # from what is detected, then twice from what the arcs predict
                table = np.concatenate([*pool.map(refine, frames, repeat(release), guesses)])
                times = crossing(table, release, times)
                arcs = strikes(table, release, times)
                drift = np.pad(film["drift"], ((0, 0), (0, 1)))
                guesses = [predict(i, release, times, arcs) + drift[i] for i in frames]
        ways = ({}, {"window": 8}, {"slope": 0.02}, {"late": 0.04}, {"late": -0.04})
        reads = [LENGTH * strikes(table, release, times, **way)[..., 1:] for way in ways]
        yield from summary(release, np.array(reads))


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("film", type=Path)
    given = parser.parse_args()
    read(given.film)
    write("film_reading.csv", COLUMNS, rows(), given.output)
