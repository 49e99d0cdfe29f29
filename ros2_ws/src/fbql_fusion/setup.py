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
    package_data={name: ["policies/*.npz"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml", "README.md", "LICENSE", "CHANGELOG.rst"]),
        (f"share/{name}/launch", sorted(map(str, Path("launch").glob("*.py")))),
        (f"share/{name}/policies", [f"{name}/policies/fbql.npz"]),
    ],
    install_requires=["setuptools", "numpy"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "fusion = fbql_fusion.programs:fusion",
            "twist_mux = fbql_fusion.programs:twist_mux",
        ]
    },
)
