"""The resources, one module for each."""

from service.routes import estimate, health, manual, metrics, runs, scenes, studies

ROUTERS = (
    studies.router,
    estimate.router,
    runs.router,
    scenes.router,
    health.router,
    metrics.router,
    manual.router,
)
