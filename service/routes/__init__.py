"""The resources, one module for each."""

from service.routes import itself, numbers, runs, scenes, studies

ROUTERS = (
    studies.router,
    studies.costs,
    runs.router,
    numbers.router,
    scenes.router,
    itself.router,
    itself.others,
)
