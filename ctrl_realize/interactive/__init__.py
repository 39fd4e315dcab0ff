"""The app: a local page, or a widget in a notebook, on which data, model and loop are drawn.

All that the page knows is the state of a `session.Session`, which takes commands and returns
drawing data, both as JSON. The page and the widget are two thin hosts of it.
"""
