"""Plans become layers: passes of a view and their results; Mitsuba and Dr.Jit are imported here alone."""

from dataset_builder.rendering.backend import name_llvm

name_llvm()
