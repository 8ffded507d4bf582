"""Any input is right, or refused: values made from the declarations, and a class for each answer to them.

`odd_values` holds what nobody should give, `strategies` makes values from declared types, `targets`, `inputs`,
`commands` and `runs` say what is called with them, `outcome` tells a clear answer from an unclear or a silent one,
`report` counts.
"""
