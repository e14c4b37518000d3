"""Which entries of a matrix cells fill."""

from dolfinx import fem

from elastune.forms.spectral.compat import custom_form


def pattern(rows: fem.Function, columns: fem.Function) -> fem.Form:
    """A bilinear form over all cells, of two fields' spaces, to create matrices by: it has no kernel.

    A form over some of the cells, as of a body's region, would leave no room for the others.
    """
    return custom_form(0, [rows.function_space, columns.function_space], rows, [], None)
