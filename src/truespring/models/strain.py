"""The order in which the components of a strain are written."""


def voigt_pairs(dim: int) -> tuple[tuple[int, int], ...]:
    """Directions of each component of a strain in Voigt's order: xx, yy, xy, or xx, yy, zz, yz, xz, xy."""
    return ((0, 0), (1, 1), (0, 1)) if dim == 2 else ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
