# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The same drag for asyncio."""

from __future__ import annotations

import asyncio
import concurrent.futures
from typing import AsyncIterator, Callable, Optional, Type, TypeVar

from .drag import Drag
from .poses import Poses
from .predictions import Frame

Result = TypeVar("Result")


def _cancel_opened(opening: "concurrent.futures.Future[Drag]") -> None:
    """Of a task that was canceled while its drag was being opened."""
    if not opening.cancelled() and opening.exception() is None:
        opening.result().cancel()


class AsyncDrag:
    """The asyncio twin of Drag, whose thread it has to itself. Made by Session.async_drag.

        async with session.async_drag(prepared=True) as drag:
            frame = await drag.move({"jaw": Pose(translation_mm=(0, -4, 0))})

    One task may receive while others send. A task that is canceled while it receives ends the drag.
    """

    def __init__(self, open_drag: Callable[[], Drag]) -> None:
        self._open_drag = open_drag
        self._thread = concurrent.futures.ThreadPoolExecutor(1, thread_name_prefix="tissueform-drag")
        self._cancelled = False
        self.drag: Drag

    async def _run(self, function: Callable[[], Result]) -> Result:
        try:
            return await asyncio.get_running_loop().run_in_executor(self._thread, function)
        except asyncio.CancelledError:
            self.cancel()
            raise

    async def __aenter__(self) -> "AsyncDrag":
        opening = self._thread.submit(self._open_drag)
        try:
            self.drag = await asyncio.wrap_future(opening)
        except BaseException:
            opening.add_done_callback(_cancel_opened)
            self._thread.shutdown(wait=False)
            raise
        return self

    async def __aexit__(self, kind: Optional[Type[BaseException]], *_: object) -> None:
        try:
            if kind is None and not self._cancelled:
                await self._run(self.drag.finish)
        finally:
            self.cancel()

    def send(self, poses: Poses, *, commit: bool = False) -> int:
        """See Drag.send. Does not block."""
        return self.drag.send(poses, commit=commit)

    async def move(self, poses: Poses, *, commit: bool = False, final: bool = False) -> Frame:
        """See Drag.move."""
        return await self._run(lambda: self.drag.move(poses, commit=commit, final=final))

    async def receive(self) -> Optional[Frame]:
        """See Drag.receive."""
        return await self._run(self.drag.receive)

    async def __aiter__(self) -> AsyncIterator[Frame]:
        while True:
            frame = await self.receive()
            if frame is None:
                return
            yield frame

    def close(self) -> None:
        """See Drag.close."""
        self.drag.close()

    def cancel(self) -> None:
        """Ends the drag and its thread. See Drag.cancel."""
        self._cancelled = True
        self.drag.cancel()
        self._thread.shutdown(wait=False)
