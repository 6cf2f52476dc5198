"""Names of entries of the library's tables, for help and for options: importing the tables takes most of a second.

A test compares each tuple with its table.
"""

#: Names of `truespring.models.LAWS`.
LAWS = (
    "linear",
    "saint-venant-kirchhoff",
    "neo-hookean",
    "hencky",
    "yeoh",
    "gent",
    "arruda-boyce",
    "mooney-rivlin",
    "ogden",
)

#: Names of `truespring.models.RULES`.
RULES = ("lloyd", "isotropic", "least-squares", "projected", "van-gelder", "biquadratic", "gaussian")

#: Names of `truespring.validity.rules.VARIANTS`.
VARIANTS = ("volume", "quadratic")

#: Names of `truespring.validity.LOAD_TYPES`: in the plane and in space.
LOAD_TYPES = ("own", "stretch", "compress", "bend", "shear", "twist")

#: Those of LOAD_TYPES in space only.
LOAD_TYPES_3D = ("twist",)

#: Names of `truespring.calibration.UNKNOWNS`.
UNKNOWNS = ("class", "region", "direction-row", "spring", "hourglass", "material")

#: Names of `truespring.exports.TARGETS`.
TARGETS = ("calculix", "abaqus", "mujoco", "sofa", "c", "warp", "febio", "gltf", "obj", "usd", "npz", "json")

#: Names of `truespring.reference.READERS`.
READERS = (
    ".frd",
    ".dat",
    ".vtu",
    ".vtk",
    ".vtp",
    ".vts",
    ".vtr",
    ".pvtu",
    ".pvtp",
    ".pvts",
    ".pvtr",
    ".pvd",
    ".vtkhdf",
    ".rst",
    ".csv",
    ".stl",
)
