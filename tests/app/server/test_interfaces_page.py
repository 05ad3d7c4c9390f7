"""The guide's page on what adding your own takes."""

import inspect

from studio import extending
from studio.app.server.interfaces_page import interfaces_page


def test_every_public_name_stands_there_with_what_it_says_of_itself() -> None:
    content = interfaces_page()["content"]
    for name in dir(extending):
        value = getattr(extending, name)
        assert f'<h2 id="{name}">' in content
        if inspect.isclass(value) or inspect.isfunction(value):
            assert inspect.getdoc(value), name


def test_what_a_racer_meets_is_described() -> None:
    content = interfaces_page()["content"]
    assert "<h3><code>log_likelihood(poses)</code></h3>" in content
    assert "<h3><code>lower</code></h3>\n<p>(D,) least values.</p>" in content
    assert "<dt><code>sigma</code></dt><dd>(D,) σ0" in content


def test_fields_and_calls_are_listed_with_their_meaning() -> None:
    content = interfaces_page()["content"]
    assert "<dt><code>log_weights</code></dt><dd>(N,) natural logs of normalised weights" in content
    assert "<h3><code>step_layer(numbers, particles, layer, problem, space, settings)</code></h3>" in content
    assert '<h2 id="TRUNK_FIRST"><code>TRUNK_FIRST</code></h2>\n<p><code>1</code></p>' in content
