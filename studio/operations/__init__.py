"""The verbs: what a person lets the studio do, each declared once by the signature of its function.

`seed: Annotated[int, Field(ge=0, description=…)] = 0` gives the keyword of `studio.track`, the option `--seed` with
its help and range (`cli/deriving.py`), the entry `seed` of the HTTP body with the same (`app/server/requests.py`) and
a row of `/guide/verbs`. `Terminal` and `Web` say where one of the two differs (`foundations/declaring.py`); `taking`
gives a verb the parameters of the request that it makes. Results are frozen records; what a route answers is
described by the record that it returns (`app/server/answers.py`). A route calls the verb with its job's progress, a
command with `shown_progress`; what a progress raises ends the work: that is how all of it is cancelled.
`tests/operations/test_declarations.py` compares the three doors.
"""
