"""The first tables."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def _text(name: str, length: int, nullable: bool = False, **more: object) -> sa.Column[str]:
    return sa.Column(name, sa.String(length), nullable=nullable, **more)  # type: ignore[arg-type]


def _int(name: str) -> sa.Column[int]:
    return sa.Column(name, sa.Integer, nullable=False)


def _row() -> tuple[sa.Column[int], sa.Column[str]]:
    project = sa.Column(
        "project_id", sa.String(20), sa.ForeignKey("projects.id", ondelete="CASCADE"), nullable=False, index=True
    )
    return sa.Column("id", sa.Integer, primary_key=True, autoincrement=True), project


def _json(name: str, nullable: bool = False) -> sa.Column[object]:
    return sa.Column(name, sa.JSON, nullable=nullable)


def upgrade() -> None:
    """Make the tables; the journal refuses every change of what it holds."""
    op.create_table(
        "projects",
        _text("id", 20, primary_key=True),
        _text("name", 200),
        _int("version"),
        _text("created", 32),
        _text("changed", 32),
    )
    op.create_table(
        "inputs", *_row(), _text("kind", 16), _int("version"), _text("sha256", 64),
        sa.Column("content", sa.Text, nullable=False), _text("created", 32),
        sa.UniqueConstraint("project_id", "kind", "version"),
    )  # fmt: skip
    op.create_table(
        "scans", *_row(), _int("number"), _text("sha256", 64), _text("origin", 16), _text("base", 16, True),
        _text("path", 16, True), _json("detail"), _text("created", 32), sa.UniqueConstraint("project_id", "number"),
    )  # fmt: skip
    op.create_table(
        "results", *_row(), _text("kind", 16), _int("number"), _text("sha256", 64), _json("inputs"), _json("options"),
        _text("verdict", 16), _json("summary"), _json("accepted", True), _text("created", 32),
        sa.UniqueConstraint("project_id", "kind", "number"),
    )  # fmt: skip
    op.create_table(
        "files", *_row(), _text("owner", 40), _text("name", 700), _text("sha256", 64, index=True),
        sa.Column("size", sa.BigInteger, nullable=False), sa.UniqueConstraint("project_id", "owner", "name"),
    )  # fmt: skip
    op.create_table(
        "jobs", _text("id", 20, primary_key=True), _row()[1], _text("kind", 16), _text("key", 64), _text("state", 16),
        _json("spec"), _int("attempts"), _json("result", True), _json("issues"), _text("created", 32), _text("changed", 32),
    )  # fmt: skip
    op.create_index("jobs_key", "jobs", ["project_id", "key"])
    op.create_index("jobs_state", "jobs", ["state"])
    op.create_table(
        "journal", sa.Column("id", sa.Integer, primary_key=True, autoincrement=True), _text("project_id", 20), _int("number"),
        _text("at", 32), _text("action", 40), _json("detail"), _text("digest", 64), sa.UniqueConstraint("project_id", "number"),
    )  # fmt: skip
    _append_only()


def _append_only() -> None:
    if op.get_bind().dialect.name == "sqlite":
        for verb in ("UPDATE", "DELETE"):
            op.execute(
                f"CREATE TRIGGER journal_no_{verb.lower()} BEFORE {verb} ON journal "
                "BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END"
            )
    else:
        for verb in ("UPDATE", "DELETE"):
            op.execute(f"CREATE RULE journal_no_{verb.lower()} AS ON {verb} TO journal DO INSTEAD NOTHING")


def downgrade() -> None:
    """Drop everything."""
    for table in ("journal", "jobs", "files", "results", "scans", "inputs", "projects"):
        op.drop_table(table)
