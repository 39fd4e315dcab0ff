"""Structured Text (IEC 61131-3) parsed by blark and run over its syntax tree."""

import operator

from blark import transform as ast
from blark.parse import parse_source_code

OPERATORS = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "<": operator.lt,
    ">": operator.gt,
    ">=": operator.ge,
}


class FunctionBlock:
    """One instance of the only function block of a text; a name must be declared to be used."""

    def __init__(self, text: str) -> None:
        (self.block,) = parse_source_code(text).transform().items
        self.values: dict[str, object] = {}
        self.fixed: set[str] = set()
        for declarations in self.block.declarations:
            constant = "constant" in str(getattr(declarations, "attrs", "")).lower()
            for item in declarations.items:
                name = str(item.variables[0].variable.name).lower()
                assert name not in self.values, f"{name} is declared twice"
                self.values[name] = self.initial(item.init)
                if constant or isinstance(declarations, ast.InputDeclarations):
                    self.fixed.add(name)

    def initial(self, init: object) -> object:
        if isinstance(init, ast.ArrayTypeInitialization):
            (span,) = init.spec.subranges
            assert int(span.start.value) == 0
            return [0.0] * (int(span.stop.value) + 1)
        if init.value is not None:
            return self.value(init.value)
        return {"BOOL": False, "DINT": 0}.get(str(init.spec.type), 0.0)

    def __call__(self, **inputs: object) -> None:
        for name, value in inputs.items():
            assert name in self.fixed
            self.values[name] = value
        self.run(self.block.body.statements)

    def run(self, statements: list[object]) -> None:
        for statement in statements:
            if isinstance(statement, ast.AssignmentStatement):
                (target,) = statement.variables
                name = str(getattr(target.name, "name", target.name)).lower()
                assert name in self.values.keys() - self.fixed, name
                value = self.value(statement.expression)
                if isinstance(target, ast.MultiElementVariable):
                    self.values[name][self.index(target)] = value
                else:
                    assert type(value) is type(self.values[name]), f"{name} := {value!r}"
                    self.values[name] = value
            else:
                assert isinstance(statement, ast.IfStatement)
                assert not statement.else_ifs
                if self.value(statement.if_expression):
                    self.run(statement.statements.statements)
                elif statement.else_clause is not None:
                    self.run(statement.else_clause.statements.statements)

    def index(self, variable: ast.MultiElementVariable) -> int:
        place = self.value(variable.elements[0].subscripts[0])
        assert isinstance(place, int)
        assert place >= 0
        return place

    def value(self, node: object) -> object:
        if isinstance(node, ast.Real):
            return float(node.value)
        if isinstance(node, ast.Integer):
            return int(node.value)
        if isinstance(node, ast.Boolean):
            return str(node.value).upper() == "TRUE"
        if isinstance(node, ast.SimpleVariable):
            return self.values[str(node.name).lower()]
        if isinstance(node, ast.MultiElementVariable):
            return self.values[str(node.name.name).lower()][self.index(node)]
        if isinstance(node, ast.ParenthesizedExpression):
            return self.value(node.expr)
        if isinstance(node, ast.UnaryOperation):
            value = self.value(node.expr)
            return not value if str(node.op).upper() == "NOT" else -value
        assert isinstance(node, ast.BinaryOperation), type(node)
        return OPERATORS[str(node.op)](self.value(node.left), self.value(node.right))
