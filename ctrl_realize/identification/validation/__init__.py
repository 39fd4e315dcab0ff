"""Validation of models: residuals, prediction, independent delay estimates."""
