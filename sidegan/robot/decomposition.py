"""Convex decomposition of hollow links' meshes by CoACD."""

import numpy as np

from sidegan.robot.fitting import Points, hull_of, split

_CONCAVE = 0.02  # largest concavity of parts, relative to half the size of the mesh
_PARTS = 48  # most parts of a mesh
_ROUNDING = 1e-7  # [m] within which a triangle on the surface of a part counts as inside

Planes = Points  # outward unit normals, and heights along them [m], (K, 4)


def decomposed(triangles: Points) -> list[Points]:
    """Triangles (N, 3, 3) [m] divided into nearly convex, nonempty parts; empty for open meshes.

    Triangles outside all of CoACD's parts go to the nearest, so that none is lost. CoACD would have to remesh
    open meshes, which may take hours.
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
    """Triangles (N, 3, 3) [m] grouped by the convex body that contains them or is nearest."""
    parts = []
    rest = triangles
    for planes in bodies:
        inside = rest
        outside = []
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
