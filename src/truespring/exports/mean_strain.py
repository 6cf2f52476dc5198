"""The stiffness that CalculiX adds to bricks of reduced integration, so that it can be taken away again.

C3D8R in CalculiX has the mean of the strain over the element, and a control of its hourglass modes (subroutines
shape8hr and hgstiffness of CalculiX 2.20, after Flanagan and Belytschko 1981).
"""

import numpy as np

from truespring.arrays import Floats

# Corners of a brick in the order of VTK, as signs, shape (8, 3).
_CORNERS = np.array([[x, y, z] for z in (-1.0, 1.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
# The hourglass modes yz, xz, xy and xyz, shape (8, 4).
_MODES = np.stack([*(np.delete(_CORNERS, axis, axis=1).prod(axis=1) for axis in range(3)), _CORNERS.prod(axis=1)], 1)
# The factor of the control: shape8hr has 0.0005.
_CONTROL = 5e-4


def hourglass_control(corners: Floats, modulus: Floats) -> Floats:
    """Return the stiffness of C3D8R against hourglass modes, the same in each direction [N/m], shape (n, k, k).

    With the derivatives B of the volume V by the corners and the modes g less their strain in z, it is 0.0005 modulus
    B : B / V g g^T.

    Args:
        corners: undeformed positions of the corners of bricks, shape (n, 8, 3) [m]; of quadrilaterals in plane strain,
            shape (n, 4, 3), the third number half the thickness, which CalculiX expands to bricks.
        modulus: component 1111 of the tangent of the material [Pa], shape (n,).
    """
    if corners.shape[1] == 4:
        brick = np.concatenate([corners * (1.0, 1.0, -1.0), corners], axis=1)
        whole = hourglass_control(brick, modulus).reshape(-1, 2, 4, 2, 4)
        return np.asarray(whole.sum(axis=(1, 3)))  # both faces move alike in the plane
    slopes = volume_slopes(corners)
    volume = (slopes * corners).sum(axis=(1, 2)) / 3  # the volume is a cubic function of the corners
    # CalculiX 2.20 subtracts only the part of z, which is all the same for parallelepipeds
    even = slopes[:, :, 2:] @ (corners[:, :, 2:].swapaxes(1, 2) @ _MODES)
    modes = _MODES - even / volume[:, None, None]
    factor = _CONTROL * modulus * (slopes**2).sum(axis=(1, 2)) / volume
    return np.asarray(factor[:, None, None] * (modes @ modes.swapaxes(1, 2)))


def volume_slopes(corners: Floats) -> Floats:
    """Return the derivatives of the volume of bricks by their corners [m^2], shape (n, 8, 3), exactly by 8 points."""
    found = np.zeros(corners.shape)
    for point in _CORNERS / np.sqrt(3):
        along = 1 + _CORNERS * point
        shape = np.stack([_CORNERS[:, i] * np.delete(along, i, axis=1).prod(axis=1) / 8 for i in range(3)], axis=1)
        jacobian = corners.swapaxes(1, 2) @ shape
        cofactors = np.stack([np.cross(*np.delete(jacobian, i, axis=2).transpose(2, 0, 1)) for i in range(3)], axis=2)
        cofactors[:, :, 1] *= -1  # the cross product of columns 0 and 2
        found += shape @ cofactors.swapaxes(1, 2)
    return found
