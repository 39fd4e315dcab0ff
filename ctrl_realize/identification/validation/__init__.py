"""Validation of models: residuals, prediction, bootstrap, independent delay estimates."""
