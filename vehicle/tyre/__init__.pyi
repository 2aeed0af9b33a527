from .coefficients import ASYMMETRY, MagicFormula, record
from .magic_formula import cornering_stiffness, forces, forces_of_four, longitudinal_stiffness, stiffnesses
from .tyre import BEYOND_TYRE, EXAMPLES, Beyond, Limits, Tyre, TyreFile, available, data, from_file, load, save, to_file

__all__ = [
    "ASYMMETRY",
    "BEYOND_TYRE",
    "EXAMPLES",
    "Beyond",
    "Limits",
    "MagicFormula",
    "Tyre",
    "TyreFile",
    "available",
    "cornering_stiffness",
    "data",
    "forces",
    "forces_of_four",
    "from_file",
    "load",
    "longitudinal_stiffness",
    "record",
    "save",
    "stiffnesses",
    "to_file",
]
