"""The registry: our models, the user's, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from prehensile.errors import InputError
from prehensile.models.packages import find_packages, resolve
from prehensile.models.registry import (
    CATEGORIES,
    DATA,
    find_model,
    list_models,
    load_spheres,
    package_map,
)

SDF = """<sdf version="1.9"><model name="m"><link name="base_link"/></model></sdf>"""


@pytest.fixture(autouse=True)
def _no_packages_around(monkeypatch, tmp_path):
    """What the machine that runs the tests holds is none of their business."""
    for name in ("PREHENSILE_MODEL_PATH", "ROS_PACKAGE_PATH"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "no_cache"))


@pytest.fixture
def mine(tmp_path) -> Path:
    """A folder of the user's own models."""
    folder = tmp_path / "mine"
    (folder / "gadget").mkdir(parents=True)
    (folder / "gadget" / "gadget.sdf").write_text(SDF)
    return folder


def test_every_folder_of_data_is_a_model_with_known_category_and_sources():
    models = {m.name: m for m in list_models()}
    assert set(models) == {p.name for p in DATA.iterdir() if p.is_dir()}
    for model in models.values():
        assert model.category in CATEGORIES[:-1]
        assert model.title
        assert model.sources
        assert model.url == f"package://prehensile/{model.name}/{model.name}.sdf"
        assert model.path.is_file()


def test_urls_mean_the_same_file_to_us_and_to_drake():
    drakes = package_map()
    for model in list_models():
        assert Path(drakes.ResolveUrl(model.url)) == model.path
        assert resolve(model.url, find_packages()) == model.path


def test_spheres_are_those_of_the_file():
    for name in ("wsg50", "banana", "foam_brick"):
        raw = yaml.safe_load((DATA / name / "spheres.yaml").read_text())
        spheres = load_spheres(name)
        assert set(spheres) == set(raw)
        for link, rows in raw.items():
            np.testing.assert_array_equal(spheres[link], rows)


def test_a_folder_of_ones_own_is_one_line(mine):
    model = find_model("gadget", {"mine": mine})
    assert model.url == "package://mine/gadget/gadget.sdf"
    assert model.category == "other"
    assert Path(package_map({"mine": mine}).ResolveUrl(model.url)) == model.path
    assert model in list_models({"mine": mine})


def test_the_environment_variable_adds_folders(mine, monkeypatch, tmp_path):
    named = tmp_path / "named"
    named.mkdir()
    (named / "package.xml").write_text("<package><name>other_name</name></package>")
    (named / "thing.urdf").write_text('<robot name="thing"/>')
    monkeypatch.setenv("PREHENSILE_MODEL_PATH", f"{mine}:{named}")
    assert find_model("gadget").url == "package://mine/gadget/gadget.sdf"
    assert find_model("thing").url == "package://other_name/thing.urdf"
    assert package_map().Contains("other_name")


def test_ros_packages_can_be_used_but_are_not_listed(monkeypatch, tmp_path):
    package = tmp_path / "ws" / "src" / "my_robot"
    package.mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>my_robot</name></package>")
    (package / "arm.urdf").write_text('<robot name="arm"/>')
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ws"))
    assert find_model("package://my_robot/arm.urdf").path == package / "arm.urdf"
    assert "arm" not in [m.name for m in list_models()]


def test_drake_models_are_never_downloaded():
    assert not package_map().Contains("drake_models")
    with pytest.raises(InputError, match="not on this machine") as error:
        resolve("package://drake_models/ycb/003_cracker_box.sdf", find_packages())
    assert "PREHENSILE_MODEL_PATH" in error.value.findings[0].mend


def test_drake_models_that_drake_has_fetched_before_are_found(monkeypatch, tmp_path):
    cached = tmp_path / "cache" / "drake" / "package_map" / "0123abcd"
    cached.mkdir(parents=True)
    (cached / "package.xml").write_text("<package><name>drake_models</name></package>")
    (cached / "a.sdf").write_text(SDF)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert resolve("package://drake_models/a.sdf", find_packages()) == cached / "a.sdf"


def test_an_unknown_model_names_what_comes_close():
    with pytest.raises(InputError, match="unknown model 'mustard_botle'") as error:
        find_model("mustard_botle")
    assert "'mustard_bottle'" in error.value.findings[0].mend


def test_an_unknown_file_of_a_package_names_what_comes_close():
    with pytest.raises(InputError, match="there is no file") as error:
        resolve("package://prehensile/iiwa8/iiwa8.sdf", find_packages())
    assert "package://prehensile/iiwa7/iiwa7.sdf" in error.value.findings[0].mend


def test_an_unknown_package_is_named():
    with pytest.raises(InputError, match="unknown package 'prehensil'"):
        resolve("package://prehensil/iiwa7/iiwa7.sdf", find_packages())


@pytest.mark.parametrize(
    "path", ["../secret.sdf", "gadget/../../secret.sdf", "link.sdf", "link/secret.sdf"]
)
def test_a_path_out_of_its_package_is_refused(mine, path):
    secret = mine.parent / "secret.sdf"
    secret.write_text(SDF)
    (mine / "link.sdf").symlink_to(secret)
    (mine / "link").symlink_to(mine.parent)
    with pytest.raises(InputError, match="leaves its package"):
        resolve(f"package://mine/{path}", {"mine": mine})


@pytest.mark.parametrize(
    "url", ["", "iiwa7.sdf", "package://", "http://x/y.sdf", "package://a\0b/c"]
)
def test_what_is_no_url_is_refused(url):
    with pytest.raises(InputError):
        resolve(url, find_packages())


@pytest.mark.parametrize(
    ("packages", "said"),
    [
        ({"mine": "/nowhere/at/all"}, "does not exist"),
        ({"prehensile": "/tmp"}, "is taken"),
        ({"a b": "/tmp"}, "cannot be the name"),
    ],
)
def test_faulty_packages_are_refused(packages, said):
    with pytest.raises(InputError, match=said) as error:
        find_packages(packages)
    assert error.value.findings[0].key == f"packages.{next(iter(packages))}"


def test_two_models_of_one_name_are_told_apart_by_url(mine, tmp_path):
    twin = tmp_path / "twin"
    twin.mkdir()
    (twin / "gadget.sdf").write_text(SDF)
    packages = {"mine": mine, "twin": twin}
    with pytest.raises(InputError, match="several models are called 'gadget'"):
        find_model("gadget", packages)
    assert find_model("package://twin/gadget.sdf", packages).path == twin / "gadget.sdf"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("base_link: [[0, 0, 0, -1]]", "radius > 0"),
        ("base_link: [[0, 0, .nan, 1]]", "radius > 0"),
        ("base_link: [[0, 0, 1]]", "radius > 0"),
        ("base_link: 3", "radius > 0"),
        ("- 1", "not a map"),
        ("base_link: [", "not valid YAML"),
    ],
)
def test_faulty_spheres_are_refused(mine, text, said):
    (mine / "gadget" / "spheres.yaml").write_text(text)
    with pytest.raises(InputError, match=said) as error:
        load_spheres("gadget", {"mine": mine})
    assert error.value.findings[0].file.endswith("spheres.yaml")


def test_a_model_without_spheres_says_so(mine):
    with pytest.raises(InputError, match="no sphere model"):
        load_spheres("gadget", {"mine": mine})


def test_a_faulty_model_yaml_is_refused(mine):
    (mine / "gadget" / "model.yaml").write_text("title: Gadget\ncategory: tool\nsources: [a]\n")
    with pytest.raises(InputError, match="unknown category 'tool'"):
        list_models({"mine": mine})
