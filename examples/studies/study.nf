// UNTRIED: nobody has run this file yet; the Snakefile beside it is tested.
// A study by Nextflow: nextflow run examples/studies/study.nf --cases ridge.jsonl --out study --tasks 16
// The folder of results is shared by all tasks; each runs what is missing of its share.

params.tasks = 16

process TASK {
    cpus 1
    memory 200.MB
    errorStrategy 'retry'
    maxRetries 3

    input:
    val task

    output:
    val task

    script:
    """
    muprime case --cases '${file(params.cases)}' --out '${file(params.out)}' --task ${task} --of ${params.tasks} --threads 1
    """
}

process GATHER {
    input:
    val tasks

    script:
    """
    muprime gather '${file(params.out)}'
    """
}

workflow {
    TASK(Channel.of(0..<params.tasks)) | collect | GATHER
}
