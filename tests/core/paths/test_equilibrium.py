"""Forces on a sheet of paths are the slopes of its energy, and Newton's method solves what it says."""

import numpy as np
import pytest
import pyvista as pv
from shapes import rigid

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.paths.bone_contact import PUSH as BONE_PUSH
from vtkmuscle.core.paths.bone_contact import BoneContacts, add_contacts
from vtkmuscle.core.paths.equilibrium import add_neighbours, add_springs, newton_step, prepare_solve
from vtkmuscle.core.paths.neighbours import MODULUS, NEIGHBOURS, RING, SHEAR_MODULUS, WIDTH, neighbours_of
from vtkmuscle.core.paths.ring_contact import add_rings, hold_in_rings, outside_of, rings_at
from vtkmuscle.core.paths.via_rings import via_ring

PUSH, ROUNDING = 100.0, 0.3
#: xx, xy, xz, yy, yz, zz of a symmetric block.
ROWS, COLUMNS = np.array([0, 0, 0, 1, 1, 2]), np.array([0, 1, 2, 1, 2, 2])


def full(blocks):
    """Return symmetric blocks (..., 6) as matrices (..., 3, 3)."""
    matrices = np.zeros((*blocks.shape[:-1], 3, 3))
    matrices[..., ROWS, COLUMNS] = matrices[..., COLUMNS, ROWS] = blocks
    return matrices


def flat(pairs, values):
    """Return the pairs (m, 2) in rows (r, 2, WIDTH), and their values (m, k) in rows (r, k, WIDTH)."""
    first, second = pairs.swapaxes(0, 1).reshape(2, -1).astype(int)
    used = first != second
    values = values.swapaxes(1, 2).reshape(len(used), -1)
    assert not values[~used].any()
    return np.column_stack([first, second])[used], values[used]


def added(x, neighbours, widths, gradient):
    """Return the springs of neighbours at x, whose forces are added to the gradient."""
    rows, springs = np.empty((x.size // 3, 8)), np.empty((len(neighbours.pairs), 6, WIDTH))
    add_neighbours(x, neighbours, widths, rows, np.empty(7 * WIDTH), gradient.reshape(-1, 3), springs)
    return springs


def pressed(gap):
    """Return the energy of a rounded contact: the integral of its force from far away, by hand."""
    inside = PUSH * (ROUNDING - gap) ** 3 / (12.0 * ROUNDING)
    deep = PUSH * (gap**2 / 2.0 + ROUNDING**2 / 6.0)
    return np.where(gap >= ROUNDING, 0.0, np.where(gap <= -ROUNDING, deep, inside))


class Sheet:
    """A sheet of four paths of seven points that go past a ball and through a ring, and what acts on it."""

    def __init__(self, rng):
        f, n = 4, 7
        line = np.linspace(-30.0, 30.0, n)
        self.x = np.zeros((f, n, 3))
        self.x[..., 2] = line
        self.x[..., 0] = 6.0 * np.arange(f)[:, None] + 9.0
        self.x += rng.uniform(-1.5, 1.5, self.x.shape)
        held = rng.normal(size=(f, n, 3, 3))
        self.held = (held @ held.transpose(0, 1, 3, 2) / 3.0)[..., ROWS, COLUMNS]
        self.pull = rng.normal(size=(f, n, 3))
        self.neighbours = neighbours_of(self.x + rng.uniform(-1.0, 1.0, self.x.shape))
        self.widths = rng.uniform(0.8, 1.3, f)
        self.radius, self.standoff = 10.0, rng.uniform(0.0, 2.0, (1, f, n))
        away = np.linalg.norm(self.x[:, 2:5], axis=2) - self.radius
        self.standoff[0, :, 2:5] = away + rng.uniform(-2.0 * ROUNDING, 2.0 * ROUNDING, away.shape)
        corners = np.array([(0.0, -9.0, 12.0), (16.0, -9.0, 12.0), (16.0, 2.0, 12.0), (0.0, 2.0, 12.0)])
        self.rings = rings_at([(0, via_ring(corners))], np.eye(4)[None], np.zeros(3), np.zeros((1, f)))
        self.points = np.zeros((1, f), dtype=np.int64)
        hold_in_rings(self.x, self.rings, self.points)

    def contacts(self, x):
        away = np.linalg.norm(x, axis=2)
        return (away - self.radius)[None] - self.standoff, (x / away[..., None])[None]

    def energy(self, x):
        """Return the energy, term by term."""
        total = 0.5 * (np.diff(x, axis=1) ** 2).sum()
        inner, held = x[:, 1:-1], full(self.held)[:, 1:-1]
        total += (inner * (np.einsum("fnij,fnj->fni", held, inner) / 2.0 - self.pull[:, 1:-1])).sum()
        (pairs, constants), n = flat(*self.neighbours), x.shape[1]
        ways = np.subtract(*x.reshape(-1, 3)[pairs.T])
        # Across the paths, by the tangents that these have now.
        now = self.x.reshape(-1, 3)
        tangents = (now[pairs + 1] - now[pairs - 1]).sum(axis=1)
        tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
        apart, ahead = np.linalg.norm(np.cross(ways, tangents), axis=1), (ways * tangents).sum(axis=1)
        width = self.widths[pairs // n].mean(axis=1)
        strains = apart - width * constants[:, 0], ahead - constants[:, 1] / width**2
        total += 0.5 * (constants[:, 2:] * np.stack(strains, axis=1) ** 2).sum()
        total += pressed(self.contacts(x)[0][:, :, 1:-1]).sum()
        centre, normal, *axes = self.rings.frames[0]
        for path in np.flatnonzero(self.points[0]):
            away = x[path, self.points[0, path]] - centre
            place = np.array(axes) @ away
            # How far outside of the rectangle, for places beside one of its sides.
            sides = np.roll(self.rings.corners, -1, axis=0) - self.rings.corners
            out = np.stack([sides[:, 1], -sides[:, 0]], axis=1) / np.linalg.norm(sides, axis=1)[:, None]
            outside = np.einsum("ki,ki->k", out, place - self.rings.corners).max()
            total += 0.5 * PUSH * (normal @ away) ** 2 + pressed(ROUNDING - outside)
        return total

    def slopes(self, x):
        """Return the gradient (f, n, 3); of its stiffness blocks (f, n, 6), and springs (r, 6, WIDTH)."""
        gradient, blocks = np.zeros_like(x), np.zeros((*x.shape[:2], 6))
        add_springs(x, self.held, self.pull, gradient, blocks)
        springs = added(x, self.neighbours, self.widths, gradient)
        pressure = np.zeros((1, *x.shape[:2]))
        add_contacts(x, *self.contacts(x), PUSH, ROUNDING, gradient, blocks, pressure)
        add_rings(x, self.rings, self.points, PUSH, ROUNDING, gradient, blocks, np.zeros_like(pressure))
        return gradient, blocks, springs


def test_the_forces_on_a_sheet_are_the_slopes_of_its_energy(rng):
    """Of springs, what holds it, neighbours of given widths and tangents, contacts and rings, all at once."""
    sheet = Sheet(rng)
    gaps = sheet.contacts(sheet.x)[0][:, :, 1:-1]
    assert (gaps < -ROUNDING).any()
    assert ((gaps > -ROUNDING) & (gaps < ROUNDING)).any()
    assert np.count_nonzero(sheet.points) > 1
    gradient, step = sheet.slopes(sheet.x)[0], 1e-5
    for path, point, axis in np.ndindex(4, 5, 3):
        there, back = sheet.x.copy(), sheet.x.copy()
        there[path, point + 1, axis] += step
        back[path, point + 1, axis] -= step
        slope = (sheet.energy(there) - sheet.energy(back)) / (2.0 * step)
        assert gradient[path, point + 1, axis] == pytest.approx(slope, rel=1e-6, abs=1e-5)


def stiffness(blocks, pairs, springs):
    """Return the matrix of the inner points, dense."""
    f, n, _ = blocks.shape
    matrix = np.zeros((f, n, 3, f, n, 3))
    for a, i in np.ndindex(f, n):
        matrix[a, i, :, a, i] = full(blocks)[a, i]
        if i < n - 1:
            matrix[a, i, :, a, i + 1] = matrix[a, i + 1, :, a, i] = -np.eye(3)
    for (p, q), spring in zip(*flat(pairs, springs), strict=True):
        (a, i), (b, j) = divmod(p, n), divmod(q, n)
        matrix[a, i, :, b, j] = matrix[b, j, :, a, i] = -full(spring)
        matrix[a, i, :, a, i] += full(spring)
        matrix[b, j, :, b, j] += full(spring)
    return matrix[:, 1:-1, :, :, 1:-1].reshape(f * (n - 2) * 3, -1)


def newtons_step(gradient, *matrix, left_over=0.1):
    """Return the step (f, n, 3) and its slope; the gradient is made 0 at the ends."""
    gradient[:, [0, -1]] = 0.0
    f, n, _ = gradient.shape
    inverses, work, step = np.empty((f + 1, n, 6)), np.empty((4, f + 1, n, 3)), np.empty_like(gradient)
    prepare_solve(*matrix, np.empty((f * n, 6)), inverses)
    return step, newton_step(gradient, *matrix, inverses, left_over, work, step)


@pytest.mark.parametrize(("left_over", "off"), [(1e-12, 1e-9), (0.1, 0.3)])
def test_a_step_of_newtons_method_solves_its_equations(rng, left_over, off):
    sheet = Sheet(rng)
    gradient, blocks, springs = sheet.slopes(sheet.x)
    matrix = stiffness(blocks, sheet.neighbours.pairs, springs)
    assert np.linalg.eigvalsh(matrix).min() > 0.0
    step, slope = newtons_step(gradient, blocks, sheet.neighbours.pairs, springs, left_over=left_over)
    known = np.linalg.solve(matrix, -gradient[:, 1:-1].ravel()).reshape(step[:, 1:-1].shape)
    assert np.linalg.norm(step[:, 1:-1] - known) < off * np.linalg.norm(known)
    assert not step[:, [0, -1]].any()
    assert slope == pytest.approx((gradient * step).sum(), rel=1e-12)
    assert slope < 0.0


def test_a_step_goes_downhill_though_a_bone_bends_the_matrix(rng):
    sheet = Sheet(rng)
    gradient, blocks, springs = sheet.slopes(sheet.x)
    blocks[..., [0, 3, 5]] -= 200.0
    step, slope = newtons_step(gradient, blocks, sheet.neighbours.pairs, springs)
    assert slope < 0.0
    assert (gradient * step).sum() < 0.0


def test_the_load_of_a_ball_is_the_slope_of_its_force(rng):
    """In closed form, in a bone that is turned: it pushes along the radius, and its normals turn."""
    ball = pv.Icosphere(radius=30.0, nsub=5)
    bone = Bone(np.array(ball.points, dtype=np.float64), ball.regular_faces)
    # Points are up to 1 mm in what the bone keeps free about it.
    ways = rng.normal(size=(2, 200, 3))
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    depth = rng.uniform(0.2, 1.0, (2, 200, 1))
    contacts = BoneContacts([(0, bone)], np.full((1, 2, 200), 6.0), 10.0)
    transforms = rigid(rng)[None]
    x = transforms[0, :3, 3] + (36.0 - depth) * ways
    near = contacts.proximity(transforms)
    contacts.update(x, near)
    gaps, normals, pressure = (
        near.gaps.reshape(1, 2, 200),
        near.normals.reshape(1, 2, 200, 3),
        np.zeros((1, 2, 200)),
    )
    rounded, unused = (BONE_PUSH, contacts.rounding), (np.zeros((2, 200, 3)), np.zeros((2, 200, 6)))
    add_contacts(x, gaps, normals, *rounded, *unused, pressure)
    force, stiffness = contacts.load(0, near, pressure[0])
    pushed = BONE_PUSH * depth
    inner = (slice(None), slice(1, -1))
    np.testing.assert_allclose(force[inner], (pushed * ways)[inner], atol=0.03 * BONE_PUSH)
    along = np.einsum("fni,fnij,fnj->fn", ways, stiffness, ways)[inner]
    np.testing.assert_allclose(along, BONE_PUSH, rtol=0.03)
    # Aside the force only turns: on the mean over the ball's flat triangles the stiffness is -force / radius.
    aside = np.cross(ways, rng.normal(size=3))
    aside /= np.linalg.norm(aside, axis=2, keepdims=True)
    turned = np.einsum("fni,fnij,fnj->fn", aside, stiffness, aside)[inner].mean()
    assert turned == pytest.approx((-pushed / (36.0 - depth))[inner].mean(), rel=0.1)
    assert not force[:, [0, -1]].any()


@pytest.mark.parametrize(
    ("rows", "n", "size"), [(4, 9, 1.0), (6, 9, 1.0), (7, 9, 1.0), (4, 33, 1.0), (7, 9, 1e-3)]
)
def test_a_strained_pair_has_the_energy_of_its_modulus(rows, n, size):
    """And a sheared one; however many paths there are, or points on each, and whatever the unit is."""
    x = np.zeros((rows * rows, n, 3))
    x[..., :2] = np.stack(np.meshgrid(*[np.linspace(0.0, 16.0, rows)] * 2), axis=-1).reshape(-1, 1, 2)
    x[..., 2] = np.linspace(0.0, 80.0, n)
    pairs, (distances, ahead, *moduli) = (part.T for part in flat(*neighbours_of(size * x)))
    paths, points = np.divmod(pairs, n)
    assert (points[0] == points[1]).all()
    beside = {4: RING, 6: RING, 7: NEIGHBOURS}[rows]
    count = np.bincount(paths.ravel(), minlength=rows * rows) / (n - 2)
    # Of many paths one at a corner has half as many: the other paths have nearer ones.
    assert count.min() == 9 if rows == 7 else count.min() >= RING
    assert count[rows * rows // 2] >= beside
    # Of a spring between n points along a path of length L and tension 1 per length: (L / (n - 1))^2.
    energy = 0.5 * np.array(moduli) * (0.1 * distances) ** 2 * (n - 1) ** 2
    known = 0.5 * RING / beside * np.array([[MODULUS], [SHEAR_MODULUS]]) * (0.1 * size * 80.0) ** 2
    np.testing.assert_allclose(energy, np.broadcast_to(known, energy.shape), rtol=1e-9)
    np.testing.assert_allclose(ahead, 0.0, atol=1e-9 * size)


def test_the_stiffness_of_springs_contacts_and_neighbours_is_the_slope_of_their_forces(rng):
    """Across a flat bone and a row, along which nothing curves; what turns the tangents is not in it."""
    x = np.zeros((2, 5, 3))
    x[..., 2], x[1, :, 0] = np.linspace(0.0, 40.0, 5), 6.0
    neighbours = neighbours_of(x)
    held, pull = np.tile([0.5, 0.1, 0.0, 0.4, 0.2, 0.6], (2, 5, 1)), rng.normal(size=x.shape)

    def forces(x):
        gradient, blocks = np.zeros_like(x), np.zeros((2, 5, 6))
        add_springs(x, held, pull, gradient, blocks)
        springs = added(x, neighbours, np.ones(2), gradient)
        normals = np.tile([1.0, 0.0, 0.0], (1, 2, 5, 1))
        gaps = (x[..., 0] - 6.1 + 6.0 * (np.arange(2) == 0)[:, None])[None]
        add_contacts(x, gaps, normals, PUSH, ROUNDING, gradient, blocks, np.zeros((1, 2, 5)))
        return gradient, stiffness(blocks, neighbours.pairs, springs)

    matrix = forces(x)[1]
    move = np.zeros_like(x)
    move[:, 1:-1, 0] = rng.normal(size=(2, 3))
    there, back = (forces(x + 1e-6 * sign * move)[0][:, 1:-1] for sign in (1.0, -1.0))
    known = (there - back)[..., 0] / 2e-6
    found = (matrix @ move[:, 1:-1].ravel()).reshape(there.shape)[..., 0]
    np.testing.assert_allclose(found, known, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("at", [(5.2, 1.0), (5.1, 5.2), (4.6, 5.3)], ids=["side", "corner", "other side"])
def test_the_stiffness_of_a_ring_is_the_slope_of_its_force(at):
    """At a side and round a corner of a square of 10 mm; a point inside has no force."""
    ring = via_ring(np.array([(-5.0, -5.0, 0.0), (5.0, -5.0, 0.0), (5.0, 5.0, 0.0), (-5.0, 5.0, 0.0)]))
    rings = rings_at([(0, ring)], np.eye(4)[None], np.zeros(3), np.zeros((1, 1)))

    def pushed(place):
        x, gradient, blocks = np.zeros((1, 3, 3)), np.zeros((1, 3, 3)), np.zeros((1, 3, 6))
        x[0, 1] = place
        held = np.zeros((1, 1, 3))
        add_rings(x, rings, np.array([[1]]), PUSH, ROUNDING, gradient, blocks, held)
        return gradient[0, 1], full(blocks)[0, 1], held

    place = np.array([*at, 0.3])
    slopes = [(pushed(place + way)[0] - pushed(place - way)[0]) / 2e-6 for way in 1e-6 * np.eye(3)]
    np.testing.assert_allclose(pushed(place)[1], slopes, rtol=1e-5, atol=1e-5)
    assert not pushed(np.array([4.99, 4.99, 0.0]))[2].any()
    outside = np.empty((1, 1))
    outside_of(rings, np.array([[(*at, -1.0), (*at, 1.0), (0.0, 0.0, 9.0)]]), outside)
    assert outside[0, 0] == pytest.approx(np.hypot(*np.maximum(np.array(at) - 5.0, 0.0)))
