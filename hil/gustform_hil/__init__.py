"""The controller on the bus: message set, bridge and bench around a CAN database.

Knows the library and code generation, never the command line. What needs python-can, cantools or autosar-e2e imports
them where it is used: they come with the extra `gustform[hil]`.
"""
