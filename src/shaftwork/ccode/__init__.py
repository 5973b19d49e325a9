"""Models as C code: equations, modes, events and integrators in plain C99, for targets without Python.

`c_export` is what a user calls, `writer` puts the code together. `c_printing` writes expressions as statements,
`set_functions` the functions of the sets of equations, `mode_tables` modes, guards and transitions as tables,
`instants` when laws of time switch. The folder
`runtime` holds the C code that is the same for all models; `NAME` in it stands for the name of the model.
"""
