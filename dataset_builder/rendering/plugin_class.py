"""Plain classes -> classes that Mitsuba takes for plugins."""


def plugin_class(methods: type, base: type) -> type:
    """A subclass of `base`, a class of Mitsuba's, that has everything the plain class `methods` has.

    Mitsuba's classes exist only where a variant is set, and their subclasses may have no second base: so plugins are
    written as plain classes, and become Mitsuba's when they are registered.

    >>> class Greeting:
    ...     def greet(self) -> str:
    ...         return f"{type(self).__name__} {self:04}"
    >>> plugin_class(Greeting, int)(7).greet()
    'Greeting 0007'
    """
    own = {name: value for name, value in vars(methods).items() if name not in ("__dict__", "__weakref__")}
    return type(methods.__name__, (base,), own)
