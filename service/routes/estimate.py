"""The estimated cost of a study, before it is submitted."""

from __future__ import annotations

import asyncio

from fastapi import APIRouter

from service.dependencies import TheComputing, TheExaminer, TheKeeper
from service.errors import REFUSED
from service.routes.studies import Content, taken_priority
from service.strict import StrictRoute
from studies import Estimate

router = APIRouter(tags=["studies"], route_class=StrictRoute)


@router.post("/estimate", responses=REFUSED)
async def estimate(
    content: Content,
    examiner: TheExaminer,
    computing: TheComputing,
    keeper: TheKeeper,
) -> Estimate:
    """Tell what a study asks for beyond the runs that are there; nothing is stored.

    `cpu_seconds` are low, likely and high. A study that asks for more than the service allows is
    refused as it is when it is submitted.
    """
    taken_priority(content)
    found = await examiner.examine(content, computing)
    await asyncio.to_thread(keeper.check_room, found)
    return found.estimate
