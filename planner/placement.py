"""Where the part is believed to be, where it is, and the correction between the two.

The corrected base is the frame in which the real part sits exactly where the program believes it sits:
`T_base_basecorr = T_base_part @ inv(T_base_partnom)`, and `T_world_basecorr = T_world_base @ T_base_basecorr` is what
goes into BASE_DATA[n]. The two relabellings of the system live here and nowhere else.
"""

from planner.frames import Transform


def assume_nominal(T_base_partnom: Transform) -> Transform:
    """Return `T_base_part` for the first program: the part is taken to be where the program believes it is."""
    _expect(T_base_partnom, "base", "partnom")
    return T_base_partnom.renamed("base", "part")


def define_corrected(T_base_partnom: Transform) -> Transform:
    """Return `T_basecorr_part`: in the corrected base the real part has, by definition, the nominal placement."""
    _expect(T_base_partnom, "base", "partnom")
    return T_base_partnom.renamed("basecorr", "part")


def correction(T_base_part: Transform, T_base_partnom: Transform) -> Transform:
    """Return `T_base_basecorr`, the correction shown to people."""
    _expect(T_base_part, "base", "part")
    return T_base_part @ define_corrected(T_base_partnom).inv()


def part_from_correction(T_base_basecorr: Transform, T_base_partnom: Transform) -> Transform:
    """Return `T_base_part`, the real part in the nominal base, of a correction."""
    _expect(T_base_basecorr, "base", "basecorr")
    return T_base_basecorr @ define_corrected(T_base_partnom)


def corrected_base(T_world_base: Transform, T_base_basecorr: Transform) -> Transform:
    """Return `T_world_basecorr`, the numbers of BASE_DATA[n]."""
    return T_world_base @ T_base_basecorr


def _expect(transform: Transform, dst: str, src: str) -> None:
    if (transform.dst, transform.src) != (dst, src):
        raise TypeError(f"expected T_{dst}_{src}, got T_{transform.dst}_{transform.src}")
