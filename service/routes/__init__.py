"""The resources, one module for each."""

from service.routes import health, manual, metrics, numbers, runs, scenes, studies

ROUTERS = (
    studies.router,
    studies.costs,
    runs.router,
    numbers.router,
    scenes.router,
    health.router,
    metrics.router,
    manual.router,
)
