"""XMP packet of a photo: position and viewing direction of the camera.

Sources: ISO 16684-1, Parrot's photo metadata. Values are in elements, not in attributes: Olympe's photo example reads
the children of the one description.
"""

from __future__ import annotations

from anafi_mav.sim.payload.jpeg_scene import UNKNOWN, Scene
from anafi_mav.units import wrap_360

HEADER = b"http://ns.adobe.com/xap/1.0/\0"
"""First bytes of an APP1 segment of a JPEG with XMP (XMP specification part 3, 1.1.3)."""

_RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
_NAMESPACES = {
    "drone-parrot": "http://www.parrot.com/drone-parrot/1.0/",
    "exif": "http://ns.adobe.com/exif/1.0/",
    "tiff": "http://ns.adobe.com/tiff/1.0/",
}


def packet(scene: Scene, camera: str, captured: float) -> bytes:
    """Return the packet of a photo that `camera` took `captured` s after the drone's start."""
    values = {
        "tiff:Make": "Parrot",
        "tiff:Model": camera,
        "drone-parrot:CameraRollDegree": f"{scene.roll:.6f}",
        "drone-parrot:CameraPitchDegree": f"{scene.pitch:.6f}",
        "drone-parrot:CameraYawDegree": f"{wrap_360(scene.heading + 180.0) - 180.0:.6f}",
        "drone-parrot:CaptureTsUs": f"{round(captured * 1e6)}",
    }
    if scene.latitude != UNKNOWN:
        values |= {
            "exif:GPSLatitude": _coordinate(scene.latitude, "N", "S"),
            "exif:GPSLongitude": _coordinate(scene.longitude, "E", "W"),
            "exif:GPSAltitude": f"{round(abs(scene.altitude) * 1000)}/1000",
            "exif:GPSAltitudeRef": "1" if scene.altitude < 0.0 else "0",
        }
    spaces = "".join(f' xmlns:{prefix}="{uri}"' for prefix, uri in _NAMESPACES.items())
    lines = "".join(f"<{name}>{value}</{name}>" for name, value in values.items())
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>'
        '<x:xmpmeta xmlns:x="adobe:ns:meta/">'
        f'<rdf:RDF xmlns:rdf="{_RDF}"><rdf:Description rdf:about=""{spaces}>{lines}</rdf:Description></rdf:RDF>'
        '</x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def _coordinate(degrees: float, positive: str, negative: str) -> str:
    """Degrees and minutes as XMP's Exif schema writes them: "48,52.734000N"."""
    whole, rest = divmod(round(abs(degrees) * 60e6), 60_000_000)
    return f"{whole},{rest / 1e6:.6f}{positive if degrees >= 0.0 else negative}"
