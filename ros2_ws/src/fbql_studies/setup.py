"""Name, version and the rest are read from package.xml, which is their one place."""

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
    package_data={name: ["rooms/*.json"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml", "README.md", "LICENSE", "CHANGELOG.rst"]),
    ],
    install_requires=["setuptools", "numpy", "PyYAML"],
    extras_require={
        "cluster": ["distributed"],
        "figures": ["matplotlib"],
        "peers": ["gymnasium", "scikit-learn", "stable-baselines3", "torch"],
        "rooms": ["ir-sim"],
        "test": ["pytest"],
    },
    zip_safe=False,
    entry_points={"fbql.commands": ["experiment = fbql_studies.experiment", "sweep = fbql_studies.sweep.command"]},
)
