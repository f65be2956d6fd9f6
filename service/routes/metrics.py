"""Metrics for monitoring."""

from __future__ import annotations

from fastapi import APIRouter, Response
from fastapi.responses import PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

from service.dependencies import TheMetrics, in_turn

router = APIRouter(tags=["metrics"])


@router.get("/metrics", response_class=PlainTextResponse)
@in_turn
def metrics(figures: TheMetrics) -> Response:
    """Return metrics in the text format of Prometheus."""
    return Response(generate_latest(figures.registry), media_type=CONTENT_TYPE_LATEST)
