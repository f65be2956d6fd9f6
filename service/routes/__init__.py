"""The resources, a module each."""

from service.routes import health, manual, runs, scenes, studies

ROUTERS = (studies.router, runs.router, scenes.router, health.router, manual.router)
