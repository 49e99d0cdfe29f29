"""Name, version and the rest are read from package.xml, which is their one place."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

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
    package_data={name: ["trees/*.json"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml", "README.md", "LICENSE", "CHANGELOG.rst"]),
        (f"share/{name}/launch", sorted(map(str, Path("launch").glob("*.py")))),
        (f"share/{name}/trees", sorted(map(str, Path(name, "trees").glob("*.json")))),
    ],
    install_requires=["setuptools", "mcap", "numpy", "zstandard"],
    extras_require={"bags": ["rosbags"], "cart": ["scikit-learn"], "test": ["pytest"]},
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "ball_seeking = fbql_behaviors.programs:ball_seeking",
            "wall_avoiding = fbql_behaviors.programs:wall_avoiding",
            "approaching = fbql_behaviors.programs:approaching",
            "behavior = fbql_behaviors.programs:behavior",
            "teleop = fbql_behaviors.programs:teleop",
            "twist_behavior = fbql_behaviors.programs:twist_behavior",
        ]
    },
)
