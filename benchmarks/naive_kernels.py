"""The constraints as one would first write them: what the fast kernels are compared with."""

from __future__ import annotations

import math

from vtkmuscle.core.jit import kernel


@kernel
def naive_distance(p, w, edges, rest, stiffness):
    """Project edge lengths, in the order of the mesh."""
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        dx, dy, dz = p[i, 0] - p[j, 0], p[i, 1] - p[j, 1], p[i, 2] - p[j, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        s = stiffness[e] * (length - rest[e]) / (w[i] + w[j]) / length
        p[i, 0] -= w[i] * s * dx
        p[i, 1] -= w[i] * s * dy
        p[i, 2] -= w[i] * s * dz
        p[j, 0] += w[j] * s * dx
        p[j, 1] += w[j] * s * dy
        p[j, 2] += w[j] * s * dz


@kernel
def naive_dihedral(p, w, quads, rest, stiffness):
    """Project dihedral angles by atan2, in the order of the mesh."""
    for q in range(len(quads)):
        i, j, k, m = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        ex, ey, ez = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1], p[j, 2] - p[i, 2]
        ax, ay, az = p[k, 0] - p[i, 0], p[k, 1] - p[i, 1], p[k, 2] - p[i, 2]
        bx, by, bz = p[m, 0] - p[i, 0], p[m, 1] - p[i, 1], p[m, 2] - p[i, 2]
        n1x, n1y, n1z = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
        n2x, n2y, n2z = by * ez - bz * ey, bz * ex - bx * ez, bx * ey - by * ex
        length = math.sqrt(ex * ex + ey * ey + ez * ez)
        a1 = n1x * n1x + n1y * n1y + n1z * n1z
        a2 = n2x * n2x + n2y * n2y + n2z * n2z
        cx, cy, cz = n1y * n2z - n1z * n2y, n1z * n2x - n1x * n2z, n1x * n2y - n1y * n2x
        sine = (cx * ex + cy * ey + cz * ez) / length
        c = math.atan2(sine, n1x * n2x + n1y * n2y + n1z * n2z) - rest[q]
        if c > math.pi:
            c -= 2.0 * math.pi
        elif c <= -math.pi:
            c += 2.0 * math.pi
        a = (ax * ex + ay * ey + az * ez) / (length * length)
        b = (bx * ex + by * ey + bz * ez) / (length * length)
        g3x, g3y, g3z = -length * n1x / a1, -length * n1y / a1, -length * n1z / a1
        g4x, g4y, g4z = -length * n2x / a2, -length * n2y / a2, -length * n2z / a2
        g2x, g2y, g2z = -a * g3x - b * g4x, -a * g3y - b * g4y, -a * g3z - b * g4z
        g1x, g1y, g1z = -g2x - g3x - g4x, -g2y - g3y - g4y, -g2z - g3z - g4z
        s1 = g1x * g1x + g1y * g1y + g1z * g1z
        s2 = g2x * g2x + g2y * g2y + g2z * g2z
        s3 = g3x * g3x + g3y * g3y + g3z * g3z
        s4 = g4x * g4x + g4y * g4y + g4z * g4z
        weighted = w[i] * s1 + w[j] * s2 + w[k] * s3 + w[m] * s4
        s = stiffness * c / max(weighted, 0.1 * (s1 + s2 + s3 + s4))
        p[i, 0] -= s * w[i] * g1x
        p[i, 1] -= s * w[i] * g1y
        p[i, 2] -= s * w[i] * g1z
        p[j, 0] -= s * w[j] * g2x
        p[j, 1] -= s * w[j] * g2y
        p[j, 2] -= s * w[j] * g2z
        p[k, 0] -= s * w[k] * g3x
        p[k, 1] -= s * w[k] * g3y
        p[k, 2] -= s * w[k] * g3z
        p[m, 0] -= s * w[m] * g4x
        p[m, 1] -= s * w[m] * g4y
        p[m, 2] -= s * w[m] * g4z
