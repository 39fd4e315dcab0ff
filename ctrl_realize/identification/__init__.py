"""From records to models: the estimators, one wing a method."""
