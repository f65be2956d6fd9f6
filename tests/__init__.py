"""The claims of solver, studies, service and the command, each as a test."""
