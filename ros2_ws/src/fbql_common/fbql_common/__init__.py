"""Shared by every package: `core`, `files` and `own_code` need no ROS; the other modules are for nodes."""

from fbql_common.core.kernels import set_compiler


def _compile_kernels() -> None:
    from fbql_common.compilation import compile_kernels

    compile_kernels()


set_compiler(_compile_kernels)
