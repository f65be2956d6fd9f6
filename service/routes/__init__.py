"""The resources, one module for each."""

from service.routes import estimate, health, manual, metrics, numbers, runs, scenes, studies

ROUTERS = (
    studies.router,
    estimate.router,
    runs.router,
    numbers.router,
    scenes.router,
    health.router,
    metrics.router,
    manual.router,
)
