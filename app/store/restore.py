"""Makes a project from an archive: nothing in it is believed; sizes, names, digests and journal are checked first."""

import json
import zipfile
from typing import IO

from pydantic import ValidationError

from app.store.archive import FORMAT, MANIFEST
from app.store.blobs import CHUNK, Blob
from app.store.content import canonical, digest_of
from app.store.journal import first_broken, note
from app.store.manifest import MAX_MEMBERS, FilePart, Manifest, check_consistent, unusable
from app.store.names import clean_text, new_id, now
from app.store.refusal import refuse
from app.store.store import Store
from app.store.tables import FileRow, InputRow, JournalRow, ProjectRow, ResultRow, ScanRow

MAX_RATIO = 200
MAX_MANIFEST_BYTES = 256 * CHUNK


def restore(store: Store, source: IO[bytes]) -> ProjectRow:
    """Make a project from an archive (a seekable file); raises Refusal 422 if anything is wrong with it.

    Call it inside `store.busy()`: the blobs are stored before the rows that name them.
    """
    try:
        with zipfile.ZipFile(source) as archive:
            members = _checked_members(archive, store.settings.max_archive_bytes)
            manifest = _manifest(archive, members)
            _check_names(manifest, members)
            check_consistent(manifest)
            for entry in manifest.files:
                _keep(store, archive, entry)
    except (zipfile.BadZipFile, NotImplementedError, EOFError, RuntimeError, UnicodeError) as error:
        raise unusable("the file is not a whole ZIP archive.") from error
    return _insert(store, manifest)


def _checked_members(archive: zipfile.ZipFile, largest: int) -> dict[str, zipfile.ZipInfo]:
    """Return the members by name after looking at what the directory declares, before unpacking anything."""
    infos = archive.infolist()
    if len(infos) > MAX_MEMBERS:
        raise unusable(f"the archive has more than {MAX_MEMBERS} files.")
    members: dict[str, zipfile.ZipInfo] = {}
    for info in infos:
        mode = info.external_attr >> 16
        is_link = (mode & 0o170000) == 0o120000
        parts = info.filename.split("/")
        if is_link or info.flag_bits & 1 or info.is_dir() or info.filename in members:
            raise unusable("the archive has links, folders, encrypted or doubled entries.")
        if (
            "\\" in info.filename
            or ":" in info.filename
            or info.filename.startswith("/")
            or {"", ".", ".."} & set(parts)
        ):
            raise unusable("the archive has entries that point outside it.")
        if info.file_size > CHUNK and info.file_size > MAX_RATIO * max(info.compress_size, 1):
            raise unusable("the archive unpacks to far more than it holds.")
        members[info.filename] = info
    if sum(info.file_size for info in infos) > largest:
        raise refuse(
            413, "archive-too-large", f"the archive unpacks to more than {largest / CHUNK:.0f} MiB.", "", "file"
        )
    return members


def _manifest(archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo]) -> Manifest:
    info = members.get(MANIFEST)
    if info is None or info.file_size > MAX_MANIFEST_BYTES:
        raise unusable(f"the archive has no {MANIFEST}.")
    with archive.open(info) as file:
        text = file.read(MAX_MANIFEST_BYTES + 1)
    try:
        content = json.loads(text)
        if not isinstance(content, dict) or content.get("format") != FORMAT:
            raise unusable("the archive was written by another version of EchoBase, or by something else.")
        manifest = Manifest.model_validate(content)
        sealed = digest_of({key: value for key, value in content.items() if key != "digest"})
    except (ValidationError, ValueError, RecursionError) as error:
        raise unusable(f"{MANIFEST} is malformed.") from error
    if sealed != manifest.digest:
        raise unusable(f"{MANIFEST} was changed after it was written.")
    if first_broken(_journal(manifest, manifest.project.id)) is not None:
        raise unusable("the journal was changed after it was written.")
    return manifest


def _check_names(manifest: Manifest, members: dict[str, zipfile.ZipInfo]) -> None:
    wanted = [entry.member for entry in manifest.files]
    if len(set(wanted)) != len(wanted) or set(wanted) | {MANIFEST} != set(members):
        raise unusable("the files of the archive are not those of its list.")


def _keep(store: Store, archive: zipfile.ZipFile, entry: FilePart) -> Blob:
    with store.writer(entry.size, "archive entry") as writer, archive.open(entry.member) as file:
        while data := file.read(CHUNK):
            if writer.size + len(data) > entry.size:
                break
            writer.write(data)
        blob = writer.finish()
    if blob.sha256 != entry.sha256 or blob.size != entry.size:
        raise unusable("a file of the archive is not what its list says.")
    if entry.name.endswith(".npz"):
        _check_arrays(store, blob)
    return blob


def _check_arrays(store: Store, blob: Blob) -> None:
    """Refuse arrays that would unpack to far more than they hold when they are loaded."""
    with store.blobs.open(blob.sha256) as file, zipfile.ZipFile(file) as arrays:
        unpacked = sum(info.file_size for info in arrays.infolist())
    if unpacked > CHUNK and unpacked > MAX_RATIO * blob.size:
        raise unusable("arrays in the archive unpack to far more than they hold.")


def _insert(store: Store, manifest: Manifest) -> ProjectRow:
    name = clean_text(manifest.project.name, "name")
    row = ProjectRow(id=new_id(), name=name, version=1, created=manifest.project.created, changed=now())
    with store.db.write() as session:
        session.add(row)
        session.flush()
        for given in manifest.inputs:
            content = {**given.model_dump(), "content": canonical(json.loads(given.content))}
            session.add(InputRow(project_id=row.id, **content))
        session.add_all(ScanRow(project_id=row.id, **scan.model_dump()) for scan in manifest.scans)
        session.add_all(ResultRow(project_id=row.id, **result.model_dump()) for result in manifest.results)
        for entry in manifest.files:
            session.add(FileRow(project_id=row.id, **entry.model_dump(exclude={"member"})))
        # The old journal stays sealed under its old project; the new one starts by naming its last seal.
        before = [line.model_dump() for line in manifest.journal]
        note(session, row.id, "project-imported", before=manifest.project.id, archive=manifest.digest, journal=before)
    return row


def _journal(manifest: Manifest, project_id: str) -> list[JournalRow]:
    return [JournalRow(project_id=project_id, **line.model_dump()) for line in manifest.journal]
