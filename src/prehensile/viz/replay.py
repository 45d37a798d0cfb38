"""Replays: one HTML file that shows a simulation again, offline, in any browser since 2023.

A :class:`Recorder` records what a Meshcat server is told while a simulation runs. Meshes and
textures are in the file, nothing is fetched. The page is packed with gzip, which the browser
undoes: resting bodies then cost next to nothing.
"""

import base64
import gzip
import os
from pathlib import Path
from types import TracebackType
from typing import Self

from pydrake.geometry import Meshcat, MeshcatAnimation

from prehensile.errors import Finding, InputError
from prehensile.files import write_atomic
from prehensile.viz.progress import progress

# A power of two: the frame number of a transform is floor(time * rate), and multiples of 1/32 s
# (and of 1/64 s, at which Drake's visualizer publishes) fall on frames without rounding.
FRAMES_PER_SECOND = 32.0
_FOREVER = 1_000_000

_PAGE = """<!DOCTYPE html>
<html>
<head>
<meta charset="utf-8">
<title>prehensile replay</title>
</head>
<body>
<p id="note">Unpacking the replay ...</p>
<script>
const packed = "{packed}";
async function show() {{
  const bytes = Uint8Array.from(atob(packed), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const page = await new Response(stream).text();
  document.open();
  document.write(page);
  document.close();
}}
show().catch((error) => {{
  document.getElementById("note").textContent =
    "This replay needs a browser with DecompressionStream (2023 or later): " + error;
}});
</script>
</body>
</html>
"""


class Recorder:
    """Records a Meshcat server and saves the recording as one HTML file.

    As a context manager it starts at entry and saves at exit, also when the block ends by an
    exception such as ``KeyboardInterrupt``: the file then holds what was recorded until then.

        with Recorder(meshcat, "replay.html"):
            simulator.AdvanceTo(60.0)
    """

    def __init__(
        self,
        meshcat: Meshcat,
        path: Path | str | None = None,
        *,
        frames_per_second: float = FRAMES_PER_SECOND,
        live: bool = True,
    ) -> None:
        """Prepares a recorder; nothing is recorded before :meth:`start`.

        Args:
            meshcat: the server that the station's ``MeshcatVisualizer`` publishes to.
            path: where the context manager saves; needed only there.
            frames_per_second: frames kept per simulated second (> 0). Powers of two suit
                Drake's visualizers best.
            live: also show what is recorded to browsers connected now.

        Raises:
            InputError: the folder of ``path`` does not exist or cannot be written to.
        """
        if not frames_per_second > 0:
            raise ValueError(f"frames_per_second must be positive, got {frames_per_second}")
        self._meshcat = meshcat
        self._path = None if path is None else Path(path)
        self._frames_per_second = frames_per_second
        self._live = live
        if self._path is not None:
            check_writable(self._path)

    def start(self, time: float = 0.0) -> None:
        """Starts recording, and forgets what was recorded before.

        Args:
            time: simulated time that becomes the first frame, in seconds.
        """
        self._meshcat.DeleteRecording()
        self._meshcat.StartRecording(
            frames_per_second=self._frames_per_second,
            set_visualizations_while_recording=self._live,
        )
        recording = self._meshcat.get_mutable_recording()
        recording.set_start_time(time)
        recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
        recording.set_repetitions(_FOREVER)

    def stop(self) -> None:
        """Stops recording; what was recorded is kept."""
        self._meshcat.StopRecording()

    def save(self, path: Path | str) -> Path:
        """Stops recording and writes the replay.

        The page shows the objects that Meshcat shows now, moving as they did since
        :meth:`start`. The file is complete or not there at all: it is written under another
        name and renamed.

        Args:
            path: file to write; an older one is replaced.

        Returns:
            The absolute path of the file.

        Raises:
            InputError: the file cannot be written.
        """
        path = Path(path).resolve()
        check_writable(path)
        self.stop()
        self._meshcat.PublishRecording()
        with progress(f"writing {path.name}") as report:
            page = pack_page(self._meshcat.StaticHtml())
            write_atomic(path, page)
            report(1, f"{len(page) / 1e6:.1f} MB")
        return path

    def __enter__(self) -> Self:
        if self._path is None:
            raise ValueError("Recorder needs a path to be used as a context manager")
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        assert self._path is not None
        self.save(self._path)


def pack_page(html: str) -> str:
    """Packs an HTML page into a smaller HTML page that unpacks itself in the browser.

    Args:
        html: the page.

    Returns:
        A page that shows the same, with the text compressed by gzip inside. Equal input gives
        equal output.
    """
    packed = gzip.compress(html.encode(), compresslevel=6, mtime=0)
    return _PAGE.format(packed=base64.b64encode(packed).decode())


def check_writable(path: Path) -> None:
    """Makes the folder of a file to be, so that a mistake shows before a long run, not after.

    Args:
        path: the file to be.

    Raises:
        InputError: ``path`` is a folder, or its own folder cannot be made or written to.
    """
    if path.is_dir():
        raise InputError(Finding("is a folder, not a file", "name a file in it", str(path)))
    folder = path.resolve().parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = f"its folder cannot be made: {error.strerror}"
        raise InputError(Finding(reason, "name another file", str(path))) from error
    if not os.access(folder, os.W_OK):
        raise InputError(Finding("its folder cannot be written to", "take another", str(path)))
