"""The command line, called in this process."""

from __future__ import annotations

from dataclasses import dataclass

from typer.testing import CliRunner

from pliant.cli.verbs import app


@dataclass
class Call:
    """The output and the exit code of one call."""

    code: int
    out: str
    err: str

    def done(self, code: int = 0) -> Call:
        """Check the exit code and return the call itself."""
        assert self.code == code, self.err
        return self

    def refused(self, *words: str) -> Call:
        """Check that the call ended with 2 and one or two sentences on standard error that contain the words."""
        said = " ".join(self.err.split())
        assert self.code == 2, said
        assert "error: " in said and "Traceback" not in said and said.count(". ") <= 3, said
        for word in words:
            assert word in said, said
        return self


def called(*words: object) -> Call:
    """Call the command; a traceback is a failure of the test."""
    result = CliRunner().invoke(app, [str(word) for word in words])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return Call(result.exit_code, result.stdout, result.stderr)
