"""The correction: its meaning, and that the two classic slips (inverse, wrong side) are far off."""

import numpy as np
import pytest

from planner.frames import FrameMismatchError, Transform
from planner.placement import assume_nominal, corrected_base, correction, define_corrected, part_from_correction

T_world_base = Transform.from_xyzabc("world", "base", [1200.0, -300.0, 450.0, 31.0, -4.0, 178.0])
T_base_partnom = Transform.from_xyzabc("base", "partnom", [80.0, 45.0, -20.0, 12.0, 3.0, -7.0])
T_base_part = Transform.from_xyzabc("base", "part", [81.1, 44.3, -19.0, 12.5, 2.2, -6.8])
T_part_tcp = Transform.from_xyzabc("part", "tcp", [300.0, 150.0, 25.0, 40.0, 2.0, 176.0])


def test_corrected_program_puts_the_tool_where_the_part_really_is():
    T_base_basecorr = correction(T_base_part, T_base_partnom)
    in_program = define_corrected(T_base_partnom) @ T_part_tcp
    reached = corrected_base(T_world_base, T_base_basecorr) @ in_program
    wanted = T_world_base @ T_base_part @ T_part_tcp
    np.testing.assert_allclose(reached.matrix, wanted.matrix, atol=1e-9)
    # The numbers in the program are those of the nominal program: only BASE changes.
    nominal = assume_nominal(T_base_partnom) @ T_part_tcp
    np.testing.assert_allclose(in_program.matrix, nominal.matrix, atol=0)


def test_inverse_and_wrong_side_are_millimetres_off():
    T_base_basecorr = correction(T_base_part, T_base_partnom)
    point = T_part_tcp.xyz_mm
    wanted = (T_world_base @ T_base_part).points(point)
    nominal = define_corrected(T_base_partnom).points(point)
    inverse = T_world_base.matrix @ np.linalg.inv(T_base_basecorr.matrix) @ [*nominal, 1.0]
    wrong_side = T_base_basecorr.matrix @ T_world_base.matrix @ [*nominal, 1.0]
    assert np.linalg.norm(inverse[:3] - wanted) > 3.0
    assert np.linalg.norm(wrong_side[:3] - wanted) > 3.0


def test_part_from_correction_is_the_inverse_of_correction():
    T_base_basecorr = correction(T_base_part, T_base_partnom)
    np.testing.assert_allclose(
        part_from_correction(T_base_basecorr, T_base_partnom).matrix, T_base_part.matrix, atol=1e-9
    )


def test_base_taught_on_the_cad_origin():
    on_origin = Transform.identity("base", "partnom")
    result = corrected_base(T_world_base, correction(T_base_part, on_origin))
    np.testing.assert_allclose(result.matrix, (T_world_base @ T_base_part).matrix, atol=1e-9)


def test_a_transform_of_other_frames_is_refused():
    with pytest.raises(TypeError, match="expected T_base_part"):
        correction(T_base_partnom, T_base_partnom)
    with pytest.raises(FrameMismatchError):
        T_base_part @ T_world_base
