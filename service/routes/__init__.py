"""The resources, a module each."""

from service.routes import health, metrics, runs, scenes, studies

ROUTERS = (studies.router, runs.router, scenes.router, health.router, metrics.router)
