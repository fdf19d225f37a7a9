"""``mcpseg view``: a run's page for this machine alone, which follows the run."""

import http.client
import json
import shutil
import signal
import subprocess
import threading

import numpy as np
import pytest

from mcpseg_cli.export.view_server import FollowedMap, serving, url_of
from mcpseg_cli.segment.labelled_run import LabelledRun
from tests.commands import MOST_S, command, invoke, segment
from tests.pages import Opened, columns_of, script
from tests.recordings import write_recording


@pytest.fixture(scope="module")
def growing(tmp_path_factory, unet_path):
    """A run of three scans, and a function that has it go on to the sixth."""
    folder = tmp_path_factory.mktemp("growing")
    write_recording(folder / "all", num_scans=6)
    shutil.copytree(folder / "all", folder / "some")
    for path in sorted((folder / "some/scans").iterdir())[3:]:
        path.unlink()

    def label(name):
        lines = (folder / "all/poses.csv").read_text().splitlines(keepends=True)
        count = len(list((folder / name / "scans").iterdir()))
        (folder / "some/poses.csv").write_text("".join(lines[: count + 1]))
        recording = folder / "some/scans", folder / "some/poses.csv"
        assert segment(recording, folder / "out", "-w", unet_path, "-q").exit_code == 0

    def go_on():
        for path in (folder / "all/scans").iterdir():
            shutil.copy2(path, folder / "some/scans")
        label("all")

    label("some")
    return folder / "out", go_on


@pytest.fixture(scope="module")
def server(growing):
    with serving(FollowedMap(growing[0])) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def ask(server, path, host=None, method="GET"):
    """Return status, headers and body of what is at a path, which is sent as it is."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=MOST_S)
    connection.putrequest(method, path, skip_host=True)
    names = [f"127.0.0.1:{server.server_port}"] if host is None else host
    for name in names:
        connection.putheader("Host", name)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, answer.headers, body


def read_map(body):
    end = 4 + int.from_bytes(body[:4], "little")
    facts = json.loads(body[4:end])
    return facts, columns_of(facts, body[end:])


def test_only_this_machine_is_answered(server):
    assert server.server_address[0] == "127.0.0.1"
    assert server.server_port > 1023


def test_the_page_may_ask_its_server_and_nobody_else(server):
    status, headers, body = ask(server, "/")
    text = body.decode("utf-8")
    assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert headers["Cache-Control"] == "no-store"
    assert "default-src 'none'" in text
    assert "connect-src 'self'" in text
    assert json.loads(script(text, "facts"))["moment"] == ask(server, "/moment")[2].decode()


def test_the_map_is_that_of_the_run(server, growing):
    facts, columns = read_map(ask(server, "/map")[2])
    with LabelledRun(growing[0]) as run:
        np.testing.assert_array_equal(columns["semantic"], run.whole().semantic)
    assert facts["num_scans"] in (3, 6)


@pytest.mark.parametrize(
    "path",
    [
        "/state.sqlite", "/run.json", "/..", "/../out/run.json", "/%2e%2e/run.json", "/?x",
        "/./map", "/map/", "/map.ply", "/scans/000000.ply", "file:///etc/passwd", "/etc/passwd",
    ],
)  # fmt: skip
def test_no_path_leads_to_a_file(server, path):
    status, _, body = ask(server, path)
    assert status == 404
    assert b"root:" not in body
    assert len(body) < 1000


@pytest.mark.parametrize("names", [["evil.example"], ["127.0.0.1"], [""], [], ["localhost:1"]])
def test_another_name_for_this_machine_is_refused(server, names):
    assert ask(server, "/map", names)[0] == 403
    twice = [f"127.0.0.1:{server.server_port}", "evil.example"]
    assert ask(server, "/map", twice)[0] == 403
    assert ask(server, "/moment", [f"localhost:{server.server_port}"])[0] == 200


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
def test_nothing_can_be_sent(server, method):
    assert ask(server, "/map", method=method)[0] == 501


def test_the_page_follows_the_run(server, growing, browser):
    opened = Opened(browser, url_of(server))
    assert opened.text("moment").startswith("scan 3 of 3")
    before, moment = opened.scene(), ask(server, "/moment")[2]

    # whoever looks at the last scan goes on to see the last one
    growing[1]()
    assert ask(server, "/moment")[2] != moment
    opened.page.locator("#moment", has_text="scan 6 of 6").wait_for(timeout=1e3 * MOST_S)
    assert not np.array_equal(opened.scene(), before)
    assert opened.complaints == []
    facts, columns = read_map(ask(server, "/map")[2])
    assert facts["num_scans"] == len(columns["scan_ends"]) == 6
    opened.close()


def heed_interrupts() -> None:
    """Undo what a shell does to the commands that it starts in the background."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def test_the_command_says_where_and_ends_when_interrupted(changing_run):
    words = command("view", changing_run.out, "--no-open")
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=heed_interrupts
    )
    url = process.stdout.readline().strip()
    assert url.startswith("http://127.0.0.1:")
    port = int(url.rstrip("/").rsplit(":", 1)[1])
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=MOST_S)
    connection.request("GET", "/moment")
    assert connection.getresponse().status == 200
    connection.close()

    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=MOST_S)
    assert process.returncode == 0
    assert "Traceback" not in said


def test_what_is_no_run_is_one_line(tmp_path):
    result = invoke("view", tmp_path, "--no-open")
    assert result.exit_code == 1
    assert len(result.stderr.splitlines()) == 1
    assert str(tmp_path) in result.stderr


def test_a_run_that_has_gone_is_said_and_the_server_stays(own_run):
    with serving(FollowedMap(own_run)) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        shutil.rmtree(own_run)
        assert ask(server, "/map")[0] == 503
        assert ask(server, "/moment")[0] == 200
        server.shutdown()
        thread.join()
