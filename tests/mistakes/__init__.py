"""What people do wrong with logs, and a judge of what `imufit diagnose` answers.

`spoils` turns a sound log into one with a mistake, `catalogue` is the table of mistakes, `sound` finds sound logs, and
`judge` writes a spoilt log, asks the command line, and says what came of it. Nothing here uses the package's own code.
"""
