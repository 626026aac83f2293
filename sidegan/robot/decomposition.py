"""Meshes of hollow links divided among convex parts that CoACD finds."""

import numpy as np

from sidegan.robot.fitting import Points, hull_of, split

_CONCAVE = 0.02  # of half the size of a mesh: dents that parts may have
_PARTS = 48  # of a mesh at most
_ROUNDING = 1e-7  # [m] by which a triangle in the surface of a part counts as inside

Planes = Points  # outward unit normals, and heights along them [m], (K, 4)


def decomposed(triangles: Points) -> list[Points]:
    """Triangles (N, 3, 3) [m] divided among nearly convex parts, each of which has some.

    Parts are a guide alone: what lies in none of them goes to the nearest, so that none is lost. An open mesh
    has none: CoACD makes it anew before it divides it, which may take hours.
    """
    import coacd
    import trimesh

    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles))
    if not mesh.is_watertight:
        return []
    coacd.set_log_level("error")
    found = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces),
        threshold=_CONCAVE,
        max_convex_hull=_PARTS,
    )
    hulls = [hull for vertices, _ in found if (hull := hull_of(np.asarray(vertices))) is not None]
    if not hulls:
        return []
    return shared_out(triangles, [np.c_[hull.equations[:, :3], -hull.equations[:, 3]] for hull in hulls])


def shared_out(triangles: Points, bodies: list[Planes]) -> list[Points]:
    """Triangles (N, 3, 3) [m] divided by the convex bodies that they lie in, or are nearest to."""
    parts, rest = [], triangles
    for planes in bodies:
        inside, outside = rest, []
        for *normal, height in planes:
            inside, beyond = split(inside, np.array(normal), height + _ROUNDING)
            outside.append(beyond)
        parts.append(inside)
        rest = np.concatenate(outside)
    if len(rest):
        middles = rest.mean(1)
        depths = [(middles @ planes[:, :3].T - planes[:, 3]).max(1) for planes in bodies]
        nearest = np.argmin(depths, axis=0)
        parts = [np.concatenate([part, rest[nearest == k]]) for k, part in enumerate(parts)]
    return [part for part in parts if len(part)]
