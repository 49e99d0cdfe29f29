"""Name, version and the rest are read from package.xml, which is their one place."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

COMMANDS = (
    "bringup",
    "compare",
    "demonstrate",
    "experiment",
    "induce",
    "lesson",
    "make_trees",
    "recover",
    "replay",
    "report",
    "sweep",
    "train",
    "tree",
    "tune",
)
"""What `ros2 run fbql NAME` runs."""

manifest = ElementTree.parse("package.xml").getroot()
name = manifest.findtext("name")
maintainer = manifest.find("maintainer")

setup(
    name=name,
    version=manifest.findtext("version"),
    description=manifest.findtext("description"),
    license=manifest.findtext("license"),
    maintainer=maintainer.text,
    maintainer_email=maintainer.get("email"),
    packages=find_packages(),
    package_data={name: ["report/assets/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml", "README.md", "LICENSE", "CHANGELOG.rst"]),
        (f"share/{name}/launch", sorted(map(str, Path("launch").glob("*.py")))),
    ],
    install_requires=["setuptools", "numpy", "PyYAML", "websockets"],
    extras_require={"figures": ["matplotlib"], "foxglove": ["foxglove-sdk"], "test": ["pytest"]},
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "fbql = fbql.cli.entry:main",
            *(f"{command} = fbql.cli.entry:executable" for command in COMMANDS),
        ]
    },
)
