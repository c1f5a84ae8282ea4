"""Local polynomial regression: values and slopes of noisy samples, with their standard errors."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Bools, Floats, Ints

#: Samples that differ by less than this part of the range of each coordinate are at one place.
SAME_PLACE = 1e-6
#: Windows grow by this factor from one candidate to the next.
WINDOW_STEP = 1.4
#: A window is chosen by the fit at this many samples, evenly among all, where there are more.
MOST_TO_CHOOSE = 200
#: A coordinate has a slope of its own in a window where its spread there, apart from what the other
#: coordinates explain of it, is at least this part of the window's half width: below it errors grow beyond
#: tenfold.
LEAST_SPREAD = 0.1
#: Singular values below this part of the largest count as 0.
RANK_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class LocalFit:
    """What a local regression found at some places.

    Attributes
    ----------
    values : (m, k) array
        Of each curve at each place.
    slopes : (m, k, d) array
        By each coordinate; 0 where it is not determined.
    slope_errors : (m, k, d) array
        Standard errors of the slopes, for noise that is independent from sample to sample; without the bias
        of the fit.
    determined : (m, d) bool array
        Whether the samples near a place separate the slope by a coordinate from those by the others.
    window : int
        How many places of samples a window holds; one more than there are says that all count alike.
    """

    values: Floats
    slopes: Floats
    slope_errors: Floats
    determined: Bools
    window: int


def local_regression(samples: Floats, curves: Floats, at: Floats) -> LocalFit:
    """Fit a polynomial to the samples about each place, in a window that suits their noise.

    A window holds the same number of places of samples everywhere, weighted by the tricube of their distance
    (Cleveland, Devlin 1988). Its size is chosen once for all curves, by generalised cross-validation (Craven,
    Wahba 1978), and then taken one candidate smaller: what is best for the values leaves a bias in the slopes
    that their standard errors do not know of (Calonico, Cattaneo, Farrell 2018). The polynomial has all
    products of two coordinates and the cube of each; where there are few samples the cubes are left out, or
    all but the linear terms.

    Parameters
    ----------
    samples : (f, d) array
        Where the curves were measured, in any order; places may come again. No coordinate is constant.
    curves : (f, k) array
        What was measured.
    at : (m, d) array
        Where values and slopes are wanted, within the range of the samples.

    Returns
    -------
    LocalFit
        With finite numbers throughout.

    Raises
    ------
    ValueError
        If there are too few places: a plane needs one more than it has coefficients.

    References
    ----------
    Cleveland, Devlin 1988, *Locally weighted regression*, doi:10.1080/01621459.1988.10478639.
    Craven, Wahba 1978, *Smoothing noisy data with spline functions*, doi:10.1007/BF01404567.
    Calonico, Cattaneo, Farrell 2018, *On the effect of bias estimation on coverage accuracy in nonparametric
    inference*, doi:10.1080/01621459.2017.1285776.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.moment_arms.local_regression import local_regression
    >>> x = np.linspace(0.0, 1.0, 9)[:, None]
    >>> local_regression(x, x**2, x[[2]]).slopes.round(6)
    array([[[0.5]]])
    """
    scale = np.ptp(samples, axis=0)
    places = distinct_places(samples)
    degree = _degree_for(len(places), samples.shape[1])
    candidates = _windows(_basis_size(samples.shape[1], degree), len(places))
    fits = [_Window(samples / scale, places / scale, size, degree) for size in candidates]
    some = np.unique(np.linspace(0, len(samples) - 1, min(len(samples), MOST_TO_CHOOSE)).astype(np.int64))
    scores = [fit.score(curves, some) for fit in fits]
    chosen = fits[max(int(np.argmin(scores)) - 1, 0)]
    residuals, freedom = chosen.residuals(curves)
    noise = np.sqrt((residuals**2).sum(axis=0) / freedom)
    rows, determined = chosen.rows(at / scale)
    slopes = np.einsum("mdf,fk->mkd", rows[:, 1:], curves) / scale
    gains = np.linalg.norm(rows, axis=2)
    return LocalFit(
        rows[:, 0] @ curves,
        slopes,
        gains[:, None, 1:] / scale * noise[:, None],
        determined,
        chosen.size,
    )


def distinct_places(samples: Floats) -> Floats:
    """Return the places (p, d) at which there are samples (f, d), each once, sorted."""
    scale = np.ptp(samples, axis=0)
    cell = np.where(scale > 0, SAME_PLACE * scale, 1.0)
    _, first = np.unique(np.round((samples - samples.min(axis=0)) / cell), axis=0, return_index=True)
    distinct: Floats = samples[first]
    return distinct


def fewest_places(dimension: int) -> int:
    """Return how many different places a regression needs: for one coordinate those of a parabola and one."""
    return _basis_size(dimension, 2 if dimension == 1 else 1) + 1


def _basis_size(dimension: int, degree: int) -> int:
    linear = 1 + dimension
    return (linear, linear + dimension * (dimension + 1) // 2, linear + dimension * (dimension + 3) // 2)[
        degree - 1
    ]


def _degree_for(n_places: int, dimension: int) -> int:
    for degree in (3, 2, 1):
        if _basis_size(dimension, degree) < n_places and (degree > 1 or dimension > 1):
            return degree
    raise InputError(
        "",
        f"there are {n_places} different places, but {dimension} coordinate(s) need "
        f"{fewest_places(dimension)}",
    )


def _windows(size: int, n_places: int) -> list[int]:
    """Return numbers of places in a window to choose from; the last one is for all of them, alike."""
    windows = [min(size + 2, n_places)]
    while windows[-1] * WINDOW_STEP < n_places:
        windows.append(int(np.ceil(windows[-1] * WINDOW_STEP)))
    return sorted({*windows, n_places, n_places + 1})


class _Window:
    """The regression with windows of one size: what it makes of curves is linear in them."""

    def __init__(self, samples: Floats, places: Floats, size: int, degree: int) -> None:
        self.samples, self.places, self.size, self.degree = samples, places, size, degree

    def score(self, curves: Floats, some: Ints) -> float:
        """Return what generalised cross-validation makes of the fit, at some of the samples."""
        fit = self.rows(self.samples[some])[0][:, 0]
        leverage = float(fit[np.arange(len(some)), some].mean())
        return float(((curves[some] - fit @ curves) ** 2).mean()) / (1.0 - leverage) ** 2

    def residuals(self, curves: Floats) -> tuple[Floats, float]:
        """Return what the fit leaves of the curves (f, k), and the degrees of freedom left."""
        fit = self.rows(self.samples)[0][:, 0]
        return curves - fit @ curves, float(((np.eye(len(fit)) - fit) ** 2).sum())

    def rows(self, at: Floats) -> tuple[Floats, Bools]:
        """Return rows (m, 1 + d, f) from curves to values and slopes, and which are determined."""
        n, dimension = self.samples.shape
        rows = np.zeros((len(at), 1 + dimension, n))
        determined = np.ones((len(at), dimension), dtype=np.bool_)
        for number, place in enumerate(at):
            half, weights = self._weights(place)
            near = weights > 0
            u, root = (self.samples[near] - place) / half, np.sqrt(weights[near])
            solve, own = _solved(_basis(u, self.degree) * root[:, None], 1 + dimension)
            rows[number][:, near] = solve * root
            rows[number, 1:] /= half
            if dimension > 1:
                determined[number] = own[1:] & _spreads_apart(u, weights[near])
                rows[number, 1:][~determined[number]] = 0.0
        return rows, determined

    def _weights(self, place: Floats) -> tuple[float, Floats]:
        """Return the half width of the window about a place, and the samples' weights in it, (f,)."""
        distances = np.sort(np.linalg.norm(self.places - place, axis=1))
        if self.size > len(self.places):
            return float(distances[-1]), np.ones(len(self.samples))
        # The next place beyond the window has weight 0.
        half = distances[self.size] if self.size < len(distances) else distances[-1] * WINDOW_STEP
        parts = np.linalg.norm(self.samples - place, axis=1) / half
        return float(half), np.clip(1.0 - parts**3, 0.0, None) ** 3


def _basis(u: Floats, degree: int) -> Floats:
    """Return the columns 1, u_i, u_i u_j and u_i^3, up to a degree."""
    columns = [np.ones(len(u)), *u.T]
    if degree > 1:
        columns += [a * b for a, b in combinations_with_replacement(u.T, 2)]
    if degree > 2:
        columns += list((u**3).T)
    return np.column_stack(columns)


def _solved(design: Floats, n_wanted: int) -> tuple[Floats, Bools]:
    """Return the first rows of the pseudo-inverse, and which of these coefficients are determined."""
    sizes = np.linalg.norm(design, axis=0)
    sizes[sizes == 0] = 1.0
    u, singular, vt = np.linalg.svd(design / sizes, full_matrices=False)
    kept = singular > RANK_TOLERANCE * singular[0]
    u, singular, vt = u[:, kept], singular[kept], vt[kept]
    solve = (vt.T[:n_wanted] / singular) @ u.T / sizes[:n_wanted, None]
    # A coefficient is determined where its unit vector is in the row space.
    determined: Bools = (vt[:, :n_wanted] ** 2).sum(axis=0) > 1.0 - 1e-6
    return solve, determined


def _spreads_apart(u: Floats, weights: Floats) -> Bools:
    """Return which coordinates (n, d) vary in the window by themselves, not only along with the others."""
    centred = (u - np.average(u, axis=0, weights=weights)) * np.sqrt(weights / weights.sum())[:, None]
    apart = np.zeros(u.shape[1], dtype=np.bool_)
    for i in range(u.shape[1]):
        others = np.delete(centred, i, axis=1)
        explained = others @ np.linalg.lstsq(others, centred[:, i], rcond=RANK_TOLERANCE)[0]
        apart[i] = np.linalg.norm(centred[:, i] - explained) >= LEAST_SPREAD
    return apart
