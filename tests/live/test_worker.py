"""Another process answers one question after another, also where one that asked has gone."""

import asyncio
import time
from collections.abc import Callable
from typing import Any

import pytest

from hopopt.live.processes.worker import Left, Worker


class Slow:
    """Answers after a while."""

    def after(self, seconds: float, answer: Any) -> Any:
        time.sleep(seconds)
        return answer


def slow(say: Callable[[str], None]) -> Slow:
    return Slow()


def test_a_question_that_is_left_makes_way_for_the_next() -> None:
    async def main() -> None:
        worker = Worker(slow)
        try:
            assert await worker.ask("after", 0.0, "first") == "first"
            for _ in range(3):
                left = asyncio.create_task(worker.ask("after", 60.0, "left"))
                await asyncio.sleep(0.05)
                worker.leave("another")
                worker.leave("after")
                async with asyncio.timeout(20):
                    with pytest.raises(Left):
                        await left
                    assert await worker.ask("after", 0.0, "next") == "next"
        finally:
            worker.stop()

    asyncio.run(main())


@pytest.mark.slow
def test_an_answer_that_nobody_waits_for_is_nobody_elses() -> None:
    async def main() -> None:
        worker = Worker(slow)
        try:
            for k in range(20):
                left = asyncio.create_task(worker.ask("after", 0.02, "left"))
                await asyncio.sleep(0.005)
                left.cancel()
                async with asyncio.timeout(20):
                    assert await worker.ask("after", 0.0, k) == k
        finally:
            worker.stop()

    asyncio.run(main())
