"""Training and exporting; the parts that need torch run where it is installed."""

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from pomona.detect.picture_file import read_picture

PICTURES = Path(__file__).parents[1] / "testdata" / "pictures"
HAS_TORCH = importlib.util.find_spec("torch") is not None
needs_torch = pytest.mark.skipif(not HAS_TORCH, reason="torch is not installed: pip install torch onnx")


@pytest.fixture
def own(tmp_path):
    """Six small pictures with boxes."""
    folder = tmp_path / "own"
    folder.mkdir()
    lines = ["image,xmin,ymin,xmax,ymax"]
    for number in range(6):
        picture = np.full((160, 160, 3), 60, np.uint8)
        cv2.circle(picture, (50 + 10 * number, 80), 20, (40, 40, 200), -1)
        assert cv2.imwrite(str(folder / f"{number}.png"), picture)
        lines.append(f"{number}.png,{30 + 10 * number},60,{70 + 10 * number},100")
    (tmp_path / "boxes.csv").write_text("\n".join(lines) + "\n")
    return folder


@pytest.mark.skipif(HAS_TORCH, reason="torch is installed")
def test_without_the_extra_the_one_command_is_told(pomona, own, tmp_path):
    code, _, err = pomona("train", own, "--boxes", tmp_path / "boxes.csv", "-o", tmp_path / "my.onnx")
    assert code == 2
    assert err == "pomona: training needs torch, not installed: pip install torch onnx\n"


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ("image,xmin,ymin,xmax,ymax\n0.png,1,2,3\n", "line 2: found 4 cells"),
        ("image,xmin,ymin,xmax,ymax\n0.png,200,2,230,9\n", "line 2: the box 200,2,230,9 is outside the picture"),
        ("image,xmin,ymin,xmax,ymax\n", "found 6 pictures with 0 boxes, expected 5 pictures or more, and boxes"),
    ],
)
def test_wrong_labels_are_one_line(pomona, own, tmp_path, lines, told):
    (tmp_path / "boxes.csv").write_text(lines)
    code, _, err = pomona("train", own, "--boxes", tmp_path / "boxes.csv", "-o", tmp_path / "my.onnx")
    assert (code, err.count("\n")) == (2, 1)
    assert told in err
    assert not (tmp_path / "my.onnx").exists()


def test_a_model_of_another_name_is_refused_before_any_work(pomona, own, tmp_path):
    code, _, err = pomona("train", own, "--boxes", tmp_path / "boxes.csv", "-o", tmp_path / "my.txt")
    assert (code, err) == (2, f"pomona: {tmp_path / 'my.txt'}: found suffix '.txt', expected .onnx\n")
    begin = tmp_path / "none.onnx"
    code, _, err = pomona("train", own, "--boxes", tmp_path / "boxes.csv", "-o", tmp_path / "my.onnx", "--begin", begin)
    assert (code, err) == (2, f"pomona: {begin}: not found, expected a model\n")


def test_what_a_training_cannot_begin_with_is_said_before_the_extra_is_asked_for(pomona, own, tmp_path):
    table, made = tmp_path / "boxes.csv", tmp_path / "my.onnx"
    code, _, err = pomona("train", own, "--boxes", table, "-o", made, "--begin", table)
    assert (code, "torch" in err) == (2, False)
    assert str(table) in err
    code, _, err = pomona("train", own, "--boxes", table, "-o", made, "--work", table)
    assert (code, err) == (2, f"pomona: {table}: found a file, expected a folder for the state of the training\n")
    assert not list(tmp_path.glob("*.training"))


@needs_torch
def test_ctrl_c_keeps_what_was_learnt_and_the_same_call_goes_on(own, tmp_path):
    import torch

    output, work = tmp_path / "my.onnx", tmp_path / "my.onnx.training"
    call = [sys.executable, "-m", "pomona", "train", own, "--boxes", tmp_path / "boxes.csv", "-o", output]
    call = [*map(str, call), "--batches", "4"]
    training = subprocess.Popen(call, stderr=subprocess.PIPE, text=True)
    while training.poll() is None and not list(work.glob("*.json")):
        time.sleep(0.01)
    training.send_signal(signal.SIGINT)
    _, err = training.communicate(timeout=120)
    assert training.returncode == 130, err
    (checkpoint,) = work.glob("*.pt")
    done = torch.load(checkpoint, weights_only=True)["done"]
    assert 1 <= done <= 4
    kept = f"pomona: {done} of 4 batches are kept in {work}: the same call goes on from there\n"
    assert err == f"{kept}pomona: interrupted\n"
    assert not output.exists()
    subprocess.run(call, check=True, capture_output=True, timeout=120)
    assert output.exists()
    assert torch.load(checkpoint, weights_only=True)["done"] == 4


@needs_torch
@pytest.mark.parametrize("damage", ["garbage", "cut off", "another network", "empty"])
def test_a_damaged_state_is_one_line(pomona, own, tmp_path, damage):
    import torch

    call = ("train", own, "--boxes", tmp_path / "boxes.csv", "-o", tmp_path / "my.onnx", "--batches", 1)
    assert pomona(*call)[0] == 0
    (checkpoint,) = (tmp_path / "my.onnx.training").glob("*.pt")
    whole = checkpoint.read_bytes()
    if damage == "another network":
        torch.save({"network": {}, "done": 1}, checkpoint)
    else:
        checkpoint.write_bytes({"garbage": b"garbage" * 99, "cut off": whole[: len(whole) // 2], "empty": b""}[damage])
    code, _, err = pomona(*call)
    assert (code, err.count("\n")) == (2, 1)
    assert err.startswith(f"pomona: {checkpoint}: found no state of this training, cut off or overwritten; expected")
    assert "remove the file, and the training begins anew" in err
    checkpoint.unlink()
    for decoded in checkpoint.parent.glob("*.u8"):
        decoded.write_bytes(decoded.read_bytes()[:100])
    for shapes in checkpoint.parent.glob("*.json"):
        shapes.write_text("[[1,")
    assert pomona(*call)[0] == 0


@needs_torch
@pytest.mark.parametrize(("rate", "batches"), [(0.001, 1), (1.0, 1)])
def test_a_training_that_spoilt_the_network_says_so(pomona, own, tmp_path, monkeypatch, rate, batches):
    from pomona.detect.training import fine_tuning

    monkeypatch.setattr(fine_tuning, "PLAN", replace(fine_tuning.PLAN, rate=rate, warm_up=1, falling=0.0))
    output, photograph = tmp_path / "my.onnx", sorted(PICTURES.glob("*.jpg"))[0]
    shutil.copy(photograph, own / "z.jpg")  # the last by name is kept apart
    lines = [line.split(",") for line in (PICTURES / "boxes.csv").read_text().splitlines()]
    with (tmp_path / "boxes.csv").open("a") as boxes:
        boxes.writelines(f"z.jpg,{','.join(line[1:5])}\n" for line in lines if line[0] == photograph.name)
    code, out, err = pomona("train", own, "--boxes", tmp_path / "boxes.csv", "-o", output, "--batches", batches)
    assert err.count("\n") == 1
    if rate == 1.0:
        assert code == 2
        assert err.startswith("pomona: the trained network finds nothing in the 1 picture kept apart, so its scores")
    else:
        assert code == 0
        assert err.startswith(f"pomona: warning: {output}: finds less than what it began with, AP50 ")
        assert "AP50 on the fifth kept apart: 0.9" in out
    assert output.exists() == (code == 0)


@needs_torch
@pytest.mark.parametrize("teacher", [0, 2])
def test_a_training_that_was_killed_goes_on_and_ends_the_same(own, tmp_path, teacher):
    import torch

    from pomona.detect.training import loop
    from pomona.detect.training.cache import cached
    from pomona.detect.training.labels import labelled_pictures

    torch.set_num_threads(1)
    samples = cached(labelled_pictures([own], tmp_path / "boxes.csv"), tmp_path / "cache")
    plan = loop.Plan(batches=3, batch=2, warm_up=1, half_precision=False, teacher=teacher)
    ends = []
    for stops in ((), (1,)):
        checkpoint = tmp_path / f"{len(ends)}.pt"

        def killed(done, _loss, stops=stops):
            if done in stops:
                raise KeyboardInterrupt

        loop.SAVED_EVERY = 1
        if stops:
            checkpointed = loop.Plan(**{**vars(plan), "batches": 3})
            with pytest.raises(KeyboardInterrupt):
                loop.train([loop.Source(samples, 1.0)], checkpointed, checkpoint, None, killed)
        network = loop.train([loop.Source(samples, 1.0)], plan, checkpoint, None, lambda _done, _loss: None)
        ends.append(network.state_dict())
    assert all(torch.equal(ends[0][name], ends[1][name]) for name in ends[0])
    kept, taught_by, batches = loop.means_of(checkpoint)
    assert batches == plan.batches
    assert all(torch.equal(ends[0][name], weights) for name, weights in kept.state_dict().items())
    assert (taught_by.wider if taught_by else 0) == teacher


@needs_torch
def test_a_teacher_that_agrees_asks_for_nothing():
    import torch

    from pomona.detect.training.loss import unlike_teacher

    torch.manual_seed(0)
    maps = torch.randn(2, 6, 8, 8)
    wanted = {"heat": torch.zeros(2, 8, 8)}
    assert unlike_teacher(maps, maps, wanted) == 0
    farther = maps.clone()
    farther[:, 1] += 1  # the left edges
    unsure = maps.clone()
    unsure[:, 0] /= 2
    assert unlike_teacher(farther, maps, wanted) > 0
    assert unlike_teacher(unsure, maps, wanted) > 0


@needs_torch
def test_the_graph_gives_what_the_network_gives(tmp_path):
    import torch

    from pomona.detect.onnx.network import Network
    from pomona.detect.training.fruit_network import FruitNetwork, folded
    from pomona.detect.training.graph import network_in, write_network

    torch.manual_seed(0)
    network = FruitNetwork()
    with torch.no_grad():
        network(torch.rand(4, 3, 64, 64))  # fills the statistics of the normalisations
    network.eval()
    write_network(tmp_path / "net.onnx", folded(network), 0.3, {})
    picture = torch.rand(3, 64, 96)
    with torch.no_grad():
        expected = network(picture[None])[0].numpy()
        again = network_in(tmp_path / "net.onnx").eval()(picture[None])[0].numpy()
    given = Network.open(tmp_path / "net.onnx").run(picture.numpy())["fruits"]
    assert given.shape == (6, 16, 24)
    assert np.abs(given - expected).max() < 1e-4
    assert np.abs(again - expected).max() < 1e-4


@needs_torch
def test_a_finished_network_is_normalised_again_and_tells_the_same():
    import torch

    from pomona.detect.shipped import EXACT, model_named
    from pomona.detect.training.fruit_network import folded, unfolded
    from pomona.detect.training.graph import network_in

    torch.manual_seed(0)
    network = network_in(model_named(EXACT)).eval()
    normalised = unfolded(network, torch.rand(3, 3, 64, 64)).eval()
    picture = torch.rand(1, 3, 64, 96)
    with torch.no_grad():
        expected = network(picture)
        for each in (normalised, folded(normalised)):
            assert (each(picture) - expected).abs().max() < 1e-3
    assert not any(module._forward_hooks for module in network.modules())


@needs_torch
def test_training_goes_on_from_what_ships_before_its_scores_were_scaled():
    import torch
    from training.begun import as_in_training

    from pomona.detect.shipped import EXACT, model_named
    from pomona.detect.training.graph import network_in

    begun = as_in_training(model_named(EXACT), torch.rand(3, 3, 64, 64)).eval()
    picture = torch.rand(1, 3, 64, 96)
    with torch.no_grad():
        expected, found = network_in(model_named(EXACT))(picture)[0], begun(picture)[0]
    assert (found[1:] - expected[1:]).abs().max() < 1e-3
    scaled = (found[0] - found[0].mean()) / found[0].std()
    assert (scaled - (expected[0] - expected[0].mean()) / expected[0].std()).abs().max() < 1e-3
    assert found[0].std() < expected[0].std()  # calibrated scores are surer than those in training


@needs_torch
def test_eight_bits_are_read_as_the_numbers_they_stand_for(tmp_path):
    import torch

    from pomona.detect.training.eight_bits import write_eight_bits
    from pomona.detect.training.fruit_network import FruitNetwork
    from pomona.detect.training.graph import network_in, write_network

    torch.manual_seed(0)
    network = FruitNetwork(normalised=False, wider=2)
    write_network(tmp_path / "exact.onnx", network, 0.3, {})
    write_eight_bits(tmp_path / "bits.onnx", tmp_path / "exact.onnx", [torch.rand(1, 3, 64, 64).numpy()])
    again = network_in(tmp_path / "bits.onnx")
    assert again.wider == 2
    for name, weights in network.state_dict().items():
        error = (again.state_dict()[name] - weights).abs().max()
        assert error <= weights.abs().max() / 126, name  # half a step of seven bits and a sign


@needs_torch
@pytest.mark.parametrize("shape", [(), (0,), (16_000_000, 0, 0, 0), (64, 3, 3, 3)])
def test_a_network_of_a_stranger_is_one_line(tmp_path, shape):
    import onnx
    from onnx import helper, numpy_helper

    from pomona.detect.training.graph import network_in
    from pomona.errors import PomonaError

    weights = numpy_helper.from_array(np.zeros(shape, np.int8), "stem.0.0.weight_quantized")
    scales = numpy_helper.from_array(np.ones(3, np.float32), "stem.0.0.weight_scale")
    onnx.save(helper.make_model(helper.make_graph([], "g", [], [], [weights, scales])), tmp_path / "other.onnx")
    with pytest.raises(PomonaError, match=r"other.onnx: (found another network|not an ONNX model)") as refused:
        network_in(tmp_path / "other.onnx")
    assert "\n" not in str(refused.value)


@needs_torch
def test_halves_only_where_the_processor_calculates_with_them(monkeypatch):
    import torch

    from pomona.detect.training import loop

    for able in (False, True):
        monkeypatch.setattr(torch.cpu, "_is_avx512_bf16_supported", lambda able=able: able)
        assert loop._halved(loop.Plan()) is able
        assert loop._halved(loop.Plan(device="cuda"))
    monkeypatch.delattr(torch.cpu, "_is_avx512_bf16_supported")
    assert not loop._halved(loop.Plan())


@needs_torch
def test_a_fine_tuned_model_is_found_by_detect(pomona, own, tmp_path):
    output = tmp_path / "my.onnx"
    code, out, _ = pomona("train", own, "--boxes", tmp_path / "boxes.csv", "-o", output, "--batches", 2)
    assert code == 0
    assert "trained on 6 pictures with 6 fruits" in out
    assert pomona("detect", own, "-o", tmp_path / "found.csv", "--model", output)[0] == 0
    # The same call is refused nothing: what was trained here may be replaced, and the finished run is not run again.
    assert pomona("train", own, "--boxes", tmp_path / "boxes.csv", "-o", output, "--batches", 2)[0] == 0
    other = tmp_path / "other.onnx"
    shutil.copy(PICTURES / "boxes.csv", other)
    code, _, err = pomona("train", own, "--boxes", tmp_path / "boxes.csv", "-o", other)
    assert code == 2
    assert "is not a model that was trained here" in err


@needs_torch
def test_eight_bits_find_what_thirty_two_find(tmp_path):
    from pomona.detect.onnx import OnnxDetector
    from pomona.detect.shipped import EXACT, SHIPPED, model_named

    picture = read_picture(next(PICTURES.glob("*.jpg")))
    small, exact = (OnnxDetector.open(model_named(name), min_score=0.5).detect(picture) for name in (SHIPPED, EXACT))
    assert abs(len(small) - len(exact)) <= 2


def test_help_of_both_verbs_loads_neither_numpy_nor_torch():
    for verb in ("detect", "train"):
        code = (
            f"import sys; sys.argv = ['pomona', '{verb}', '--help']\n"
            "from pomona.cli import main\n"
            "try:\n    main()\nexcept SystemExit as ended:\n    assert not ended.code\n"
            "assert not {'numpy', 'torch', 'onnx'} & set(sys.modules)\n"
        )
        subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, env=os.environ)
