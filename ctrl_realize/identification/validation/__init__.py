"""How far a model can be trusted: residuals, prediction, bootstrap, independent delay estimates."""
