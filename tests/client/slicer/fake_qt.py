# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""PythonQt by PyQt5, without a display: properties are attributes, and connect takes a signal by name. The panel is the real .ui file;
3D Slicer's own widgets are simple ones here."""

import os
import re
import sys
import types

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PyQt5 import QtCore, QtWidgets, uic  # noqa: E402  (the platform is set first)

APPLICATION = QtWidgets.QApplication.instance() or QtWidgets.QApplication(["tissueform"])


class PythonQt:
    """A Qt object as PythonQt shows it."""

    def __init__(self, qobject):
        object.__setattr__(self, "_qobject", qobject)

    def _has_property(self, name):
        return self._qobject.metaObject().indexOfProperty(name) >= 0

    def __getattr__(self, name):
        if name == "name":
            return self._qobject.objectName()
        if self._has_property(name):
            return self._qobject.property(name)
        attribute = getattr(self._qobject, name)
        if not callable(attribute):
            raise AttributeError(f"PythonQt has no property {name}")
        return lambda *arguments: attribute(*[unwrapped(argument) for argument in arguments])

    def __setattr__(self, name, value):
        if not self._has_property(name):
            raise AttributeError(f"{type(self._qobject).__name__} has no property {name}")
        self._qobject.setProperty(name, value)

    def connect(self, signal, slot):
        """signal: "clicked(bool)"."""
        name = re.fullmatch(r"(\w+)\(.*\)", signal)[1]
        if not any(bytes(self._qobject.metaObject().method(i).methodSignature()).decode() == signal.replace("vtkMRMLNode*", "PyQt_PyObject")
                   for i in range(self._qobject.metaObject().methodCount())):
            raise ValueError(f"there is no signal {signal}")
        getattr(self._qobject, name).connect(slot)


def unwrapped(value):
    return value._qobject if isinstance(value, PythonQt) else value


class qMRMLNodeComboBox(QtWidgets.QComboBox):  # noqa: N801  (3D Slicer's name)
    currentNodeChanged = QtCore.pyqtSignal(object)

    def __init__(self, parent=None):
        super().__init__(parent)
        self.nodes, self.types, self.scene = [None], [], None
        self.currentIndexChanged.connect(lambda index: self.currentNodeChanged.emit(self.currentNode()))

    def setNodeTypes(self, types):
        self.types = types

    def setNoneEnabled(self, enabled):
        self.addItem("None" if enabled else "")

    def _ignored(self, value):
        pass

    setAddEnabled = setRemoveEnabled = setShowChildNodeTypes = _ignored

    def setMRMLScene(self, scene):
        self.scene = scene

    def currentNode(self):
        return self.nodes[max(self.currentIndex(), 0)]

    def setCurrentNode(self, node):
        if node is None:
            self.setCurrentIndex(0)
            return
        assert self.scene is not None and any(node.IsA(kind) for kind in self.types), f"{self.objectName()} does not take {node.GetID()}"
        self.nodes.append(node)
        self.addItem(node.GetName())
        self.setCurrentIndex(len(self.nodes) - 1)


class ctkCollapsibleButton(QtWidgets.QGroupBox):  # noqa: N801
    def setText(self, text):
        self.setTitle(text)

    def setCollapsed(self, collapsed):
        self.is_collapsed = collapsed


class ctkPathLineEdit(QtWidgets.QWidget):  # noqa: N801
    Dirs, Files = 1, 2

    def __init__(self, parent=None):
        super().__init__(parent)
        self.line, layout = QtWidgets.QLineEdit(), QtWidgets.QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.line)
        layout.addWidget(QtWidgets.QToolButton(text="..."))

    def setFilters(self, filters):
        self.filters = filters

    currentPath = QtCore.pyqtProperty(str, lambda self: self.line.text(), lambda self, path: self.line.setText(path))


def load_ui(path):
    for kind in (qMRMLNodeComboBox, ctkCollapsibleButton, ctkPathLineEdit):
        holder = types.ModuleType(kind.__name__)
        setattr(holder, kind.__name__, kind)
        sys.modules[kind.__name__] = holder
    return PythonQt(uic.loadUi(path))


def child_widget_variables(panel):
    children = panel._qobject.findChildren(QtWidgets.QWidget)
    return types.SimpleNamespace(**{child.objectName(): PythonQt(child) for child in children if child.objectName()})


def new_layout():
    panel = QtWidgets.QWidget()
    layout = QtWidgets.QVBoxLayout(panel)
    layout.panel = panel  # which lives as long as its layout
    return PythonQt(layout)


def process_events():
    APPLICATION.processEvents()


def module():
    qt = types.ModuleType("qt")
    qt.QComboBox = lambda: PythonQt(QtWidgets.QComboBox())
    qt.QTimer = lambda: PythonQt(QtCore.QTimer())
    qt.QTableWidgetItem = QtWidgets.QTableWidgetItem
    return qt
