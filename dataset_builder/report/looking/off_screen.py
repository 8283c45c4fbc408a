"""VTK without a window, on machines with and without a display."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pyvista import Plotter


def plotter(width: int, height: int) -> "Plotter":
    """A PyVista plotter that draws into memory, white, so many pixels large. Close it."""
    from vtkmodules.vtkCommonCore import vtkLogger

    # It says that there is no display before it does without
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    import pyvista

    made = pyvista.Plotter(off_screen=True, window_size=[width, height], border=False)
    made.set_background("white")
    return made
