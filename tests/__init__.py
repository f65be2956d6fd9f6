"""The claims of solver, studies and service, each as a test."""
