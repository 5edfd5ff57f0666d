"""The modelling language: what a component author imports."""

from gustform.language.component import Component
from gustform.language.connector import Connector, Flow, Port, Potential
from gustform.language.declare import Discrete, Input, Output, Parameter, Part, Table, Variable
from gustform.language.errors import GustformError, Place
from gustform.language.operators import dead_band, limit, maximum, minimum, quantity, table2

__all__ = [
    "Component",
    "Connector",
    "Discrete",
    "Flow",
    "GustformError",
    "Input",
    "Output",
    "Parameter",
    "Part",
    "Place",
    "Port",
    "Potential",
    "Table",
    "Variable",
    "dead_band",
    "limit",
    "maximum",
    "minimum",
    "quantity",
    "table2",
]
