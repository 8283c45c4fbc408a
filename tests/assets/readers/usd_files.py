"""USD files for tests, written as text."""

import textwrap

from PIL import Image

HEAD = '#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Y"\n)\n'


def mesh(name="square", *, points="(0,0,0), (1,0,0), (1,1,0), (0,1,0)", counts="4", indices="0, 1, 2, 3", more="",
         metadata="", scheme="none"):
    """A mesh prim, a square of 1 x 1 unless told otherwise."""
    return textwrap.dedent(f"""
        def Mesh "{name}" ({metadata}) {{
            point3f[] points = [{points}]
            int[] faceVertexCounts = [{counts}]
            int[] faceVertexIndices = [{indices}]
            uniform token subdivisionScheme = "{scheme}"
            {more}
        }}
        """)


def material(inputs, *, name="paint", nodes="", identifier="UsdPreviewSurface"):
    """A material, whose surface has the given inputs, with other shaders beside it."""
    return textwrap.dedent(f"""
        def Material "{name}" {{
            token outputs:surface.connect = </{name}/surface.outputs:surface>
            def Shader "surface" {{
                uniform token info:id = "{identifier}"
                {inputs}
                token outputs:surface
            }}
            {nodes}
        }}
        """)


def texture(name, file, *, material="paint", more="", coordinates="st"):
    """A texture node with its own reader of coordinates."""
    return f"""
            def Shader "{name}" {{
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @{file}@
                float2 inputs:st.connect = </{material}/{name}_st.outputs:result>
                {more}
                float3 outputs:rgb
                float outputs:r
                float outputs:g
                float outputs:b
                float outputs:a
            }}
            def Shader "{name}_st" {{
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "{coordinates}"
                float2 outputs:result
            }}"""


BOUND = "rel material:binding = </{}>"
API = 'prepend apiSchemas = ["MaterialBindingAPI"]'
ST = 'texCoord2f[] primvars:st = [(0,0), (1,0), (1,1), (0,1)] ( interpolation = "vertex" )'


def painted(inputs, *, nodes="", more=ST):
    """A square with a material."""
    return HEAD + mesh(more=f"{BOUND.format('paint')}\n{more}", metadata=API) + material(inputs, nodes=nodes)


def write(folder, text, name="a.usda"):
    """The file, in the form that its suffix asks for."""
    path = folder / name
    if path.suffix == ".usda":
        path.write_text(text)
        return path
    from pxr import Sdf

    (folder / "written.usda").write_text(text)
    Sdf.Layer.FindOrOpen(str(folder / "written.usda")).Export(str(path))
    (folder / "written.usda").unlink()
    return path


def write_image(folder, name, color, mode="RGB"):
    """An image of one colour."""
    Image.new(mode, (2, 2), color).save(folder / name)
