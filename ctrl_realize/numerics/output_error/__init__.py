"""Output-error estimation of models with dead time from time records."""
